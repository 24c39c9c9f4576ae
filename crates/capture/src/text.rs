//! Numbers and words in lines of bytes.

/// The words of a line.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty())
}

/// The next word of `rest`, which becomes what is behind it.
pub(crate) fn word<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let line = rest.trim_ascii_start();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    let (word, behind) = line.split_at(end);
    *rest = behind;
    (!word.is_empty()).then_some(word)
}

/// A hexadecimal digit.
pub(crate) const fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        b'A'..=b'F' => Some(byte - b'A' + 10),
        _ => None,
    }
}

/// A hexadecimal number of 1 to 8 digits.
pub(crate) fn hex(word: &[u8]) -> Option<u32> {
    if word.is_empty() || word.len() > 8 {
        return None;
    }
    word.iter().try_fold(0, |number, &byte| Some(number << 4 | u32::from(digit(byte)?)))
}

/// A decimal number.
pub(crate) fn decimal(word: &[u8]) -> Option<u32> {
    let all_digits = !word.is_empty() && word.iter().all(u8::is_ascii_digit);
    all_digits.then(|| std::str::from_utf8(word).ok()?.parse().ok()).flatten()
}

/// Seconds with decimals, as nanoseconds: `1436509053.249713`. More than nine decimals are cut.
pub(crate) fn nanoseconds(word: &[u8]) -> Option<i64> {
    let (word, sign) = match word {
        [b'-', rest @ ..] => (rest, -1),
        _ => (word, 1),
    };
    let (mut total, mut decimals, mut digits) = (0i64, None, 0);
    for &byte in word {
        match (byte, decimals) {
            (b'.', None) => decimals = Some(0),
            (b'0'..=b'9', Some(9)) => {}
            (b'0'..=b'9', _) => {
                total = total.checked_mul(10)?.checked_add(i64::from(byte - b'0'))?;
                decimals = decimals.map(|count| count + 1);
                digits += 1;
            }
            _ => return None,
        }
    }
    if digits == 0 {
        return None;
    }
    total.checked_mul(10i64.checked_pow(9 - decimals.unwrap_or(0))?)?.checked_mul(sign)
}

/// Appends bytes as hexadecimal digits, with `between` between two bytes.
pub fn push_hex(out: &mut String, bytes: &[u8], between: &str) {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    for (n, byte) in bytes.iter().enumerate() {
        if n > 0 {
            out.push_str(between);
        }
        out.push(char::from(DIGITS[usize::from(byte >> 4)]));
        out.push(char::from(DIGITS[usize::from(byte & 0x0F)]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_exact() {
        assert_eq!(nanoseconds(b"1436509053.249713"), Some(1_436_509_053_249_713_000));
        assert_eq!(nanoseconds(b"000.000001"), Some(1_000));
        assert_eq!(nanoseconds(b"-0.5"), Some(-500_000_000));
        assert_eq!(nanoseconds(b"7"), Some(7_000_000_000));
        assert_eq!(nanoseconds(b"0.1234567891"), Some(123_456_789));
        for wrong in
            [&b""[..], b".", b"-", b"1.2.3", b"1e3", b"99999999999999999999", b"9999999999999"]
        {
            assert_eq!(nanoseconds(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn numbers_have_only_digits() {
        assert_eq!(hex(b"1fF"), Some(0x1FF));
        assert_eq!((hex(b""), hex(b"1x"), hex(b"123456789")), (None, None, None));
        assert_eq!(decimal(b"64"), Some(64));
        assert_eq!((decimal(b"+1"), decimal(b""), decimal(b"99999999999")), (None, None, None));
    }
}
