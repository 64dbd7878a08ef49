//! Inputs that are several files.

/// Stands between the files of an input; text, so that a corpus can be read and edited.
pub(crate) const BETWEEN: &[u8] = b"\n--8<--\n";

/// The files of an input; those that are not there are empty, and the last takes all that is left.
pub(crate) fn split<const N: usize>(data: &[u8]) -> [&[u8]; N] {
    let mut rest = data;
    std::array::from_fn(|index| {
        let found = rest.windows(BETWEEN.len()).position(|window| window == BETWEEN);
        match found.filter(|_| index + 1 < N) {
            Some(at) => {
                let part = &rest[..at];
                rest = &rest[at + BETWEEN.len()..];
                part
            }
            None => std::mem::take(&mut rest),
        }
    })
}

/// The input that is split into `parts`.
pub(crate) fn join(parts: &[&[u8]]) -> Vec<u8> {
    parts.join(BETWEEN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_joined_is_split_again_and_missing_files_are_empty() {
        let joined = join(&[b"a = 1", b"", b"\x00\n--8<--\n"]);
        assert_eq!(split::<3>(&joined), [&b"a = 1"[..], b"", b"\x00\n--8<--\n"]);
        assert_eq!(split::<2>(b"alone"), [&b"alone"[..], b""]);
    }
}
