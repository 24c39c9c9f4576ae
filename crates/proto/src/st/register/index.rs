//! Finds the row of a register's id. Ids may be sparse: the index has an entry for each run of
//! consecutive ids. The compiler computes it.

/// Consecutive ids, whose rows are consecutive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    first: u16,
    count: u16,
    /// The row of the first id.
    row: u16,
}

/// Rows by id.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Index<const RUNS: usize>([Run; RUNS]);

/// The number of runs in these ids. Fails unless the ids ascend.
pub(super) const fn runs(ids: &[u16]) -> usize {
    let mut runs = 1;
    let mut row = 1;
    while row < ids.len() {
        assert!(ids[row - 1] < ids[row], "a row is out of order, or its id is used twice");
        if ids[row - 1] + 1 < ids[row] {
            runs += 1;
        }
        row += 1;
    }
    runs
}

impl<const RUNS: usize> Index<RUNS> {
    /// The index of rows with these ids.
    pub(super) const fn new(ids: &[u16]) -> Self {
        assert!(RUNS == runs(ids), "the index has a wrong size");
        let mut index = [Run { first: ids[0], count: 1, row: 0 }; RUNS];
        let mut run = 0;
        let mut row = 1;
        while row < ids.len() {
            if ids[row - 1] + 1 == ids[row] {
                index[run].count += 1;
            } else {
                run += 1;
                index[run] = Run { first: ids[row], count: 1, row: row as u16 };
            }
            row += 1;
        }
        Index(index)
    }

    /// The row of an id.
    #[inline(always)]
    pub(super) fn row(&self, id: u16) -> Option<usize> {
        let behind = self.0.partition_point(|run| run.first <= id);
        let run = self.0.get(behind.wrapping_sub(1))?;
        let offset = id.wrapping_sub(run.first);
        (offset < run.count).then(|| usize::from(run.row.wrapping_add(offset)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows<const RUNS: usize>(ids: &[u16]) {
        let index = Index::<RUNS>::new(ids);
        for id in 0..=u16::MAX {
            assert_eq!(index.row(id), ids.iter().position(|&known| known == id), "{id:#06x}");
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn ids_have_their_rows_and_gaps_have_none() {
        rows::<1>(&[0, 1, 2, 3]);
        rows::<1>(&[7]);
        rows::<2>(&[1, 2, 0xFFFE, 0xFFFF]);
        rows::<5>(&[0, 0x0019, 0x0059, 0x005A, 0x0099, 0x8000]);
    }

    #[test]
    #[should_panic(expected = "out of order")]
    fn a_duplicate_id_is_refused() {
        runs(&[1, 2, 2, 3]);
    }

    #[test]
    #[should_panic(expected = "out of order")]
    fn descending_ids_are_refused() {
        runs(&[1, 2, 4, 3]);
    }
}
