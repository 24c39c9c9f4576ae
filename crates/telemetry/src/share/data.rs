//! Samples as binary columns, which a browser can use as typed arrays without a copy.

use super::VERSION;

/// The bytes before the columns. The columns are aligned to 8 bytes in a payload.
pub const HEADER: usize = 32;
/// The columns that every group has before those of its signals: `t` and `span`.
pub const TIMES: usize = 2;

/// Where the group is in a payload.
const GROUP: std::ops::Range<usize> = 4..8;

/// The group of samples, without reading them.
pub fn group_of(payload: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(payload.get(GROUP)?.try_into().ok()?))
}

/// Gives samples to another group.
pub fn regroup(payload: &mut [u8], group: u32) {
    if let Some(bytes) = payload.get_mut(GROUP) {
        bytes.copy_from_slice(&group.to_le_bytes());
    }
}

/// Rows of one group of signals. All values of a row were read in one exchange.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// The group, which a text described before.
    pub group: u32,
    /// The number of this message in its group, from 0. It wraps around.
    pub sequence: u32,
    /// Records of the subscription that were lost just before these rows, because the program was
    /// too slow.
    pub lost: u32,
    /// The zero of the column `t`, in seconds of the line's clock.
    pub t0: f64,
    /// The columns: `t`, `span`, then one for each signal. All have the same length, at least 1. NaN
    /// is no value.
    pub columns: Vec<Vec<f64>>,
}

/// The bytes are no samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DataError {
    /// Another version.
    #[error("the samples have version {0}; this program reads version {VERSION}")]
    Version(u32),
    /// The size does not go with the header, or there are no rows or no times.
    #[error("damaged samples")]
    Damaged,
}

impl Data {
    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// The bytes; `None` without rows or times, or with columns of several lengths.
    pub fn encode(&self) -> Option<Vec<u8>> {
        let rows = self.rows();
        let is_whole = self.columns.iter().all(|column| column.len() == rows);
        if rows == 0 || !is_whole || self.columns.len() < TIMES {
            return None;
        }
        let (rows, columns) = (u32::try_from(rows).ok()?, u32::try_from(self.columns.len()).ok()?);
        let numbers = [VERSION, self.group, self.sequence, rows, columns, self.lost];
        let mut bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        bytes.extend(self.t0.to_le_bytes());
        bytes.extend(self.columns.iter().flatten().flat_map(|value| value.to_le_bytes()));
        Some(bytes)
    }

    /// The samples in a payload.
    ///
    /// # Errors
    /// The bytes are not those of samples of this version.
    pub fn decode(payload: &[u8]) -> Result<Self, DataError> {
        let (header, values) = payload.split_at_checked(HEADER).ok_or(DataError::Damaged)?;
        let number = |at: usize| match header.get(at * 4..at * 4 + 4) {
            Some(&[a, b, c, d]) => Ok(u32::from_le_bytes([a, b, c, d])),
            _ => Err(DataError::Damaged),
        };
        let version = number(0)?;
        if version != VERSION {
            return Err(DataError::Version(version));
        }
        let (rows, columns) = (number(3)? as usize, number(4)? as usize);
        let size = rows.checked_mul(columns).and_then(|count| count.checked_mul(8));
        if rows == 0 || columns < TIMES || size != Some(values.len()) {
            return Err(DataError::Damaged);
        }
        let (values, _) = values.as_chunks::<8>();
        let values: Vec<f64> = values.iter().map(|value| f64::from_le_bytes(*value)).collect();
        Ok(Data {
            group: number(1)?,
            sequence: number(2)?,
            lost: number(5)?,
            t0: f64::from_bits(u64::from(number(6)?) | u64::from(number(7)?) << 32),
            columns: values.chunks(rows).map(<[f64]>::to_vec).collect(),
        })
    }
}
