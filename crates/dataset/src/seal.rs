//! A hash of the whole file inside the file. It finds damage before the Parquet decoder sees a byte: that decoder has
//! no checksums and panics on some damaged pages.
//!
//! Parquet is `pages, footer, length of the footer, "PAR1"`, and the footer says where the pages are. So no reader
//! looks at bytes between pages and footer. The seal lies there, and other readers still see a Parquet file.

const MAGIC: &[u8; 8] = b"surmise1";
pub(crate) const SEAL_LEN: usize = MAGIC.len() + blake3::OUT_LEN;

/// The Parquet file with its seal.
///
/// # Panics
///
/// If the bytes are not a Parquet file.
pub(crate) fn seal(mut parquet: Vec<u8>) -> Vec<u8> {
    let at = footer_start(&parquet).expect("the writer made a Parquet file");
    let hash = blake3::hash(&parquet);
    parquet.splice(at..at, MAGIC.iter().chain(hash.as_bytes()).copied());
    parquet
}

/// Checks that every byte is as it was sealed; otherwise the reason.
pub(crate) fn check(sealed: &[u8]) -> Result<(), String> {
    let footer = footer_start(sealed).ok_or("it is truncated or not Parquet")?;
    let before = footer.checked_sub(SEAL_LEN).ok_or("it is damaged, or was not written by this program")?;
    let (magic, hash) = sealed[before..footer].split_at(MAGIC.len());
    let mut hasher = blake3::Hasher::new();
    hasher.update(&sealed[..before]);
    hasher.update(&sealed[footer..]);
    if magic != MAGIC {
        return Err("it is damaged, or was not written by this program: it has no seal before the footer".into());
    }
    if hasher.finalize().as_bytes() != hash {
        return Err("it is damaged: its bytes do not match the hash in its seal".into());
    }
    Ok(())
}

/// Position of the footer, if the end looks like that of a Parquet file.
pub(crate) fn footer_start(bytes: &[u8]) -> Option<usize> {
    let (rest, end) = bytes.split_last_chunk::<4>()?;
    let (rest, length) = rest.split_last_chunk::<4>()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    if end == b"PAR1" { rest.len().checked_sub(length) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_changed_missing_or_added_byte_breaks_the_seal() {
        let mut parquet = b"PAR1 pages and the footer".to_vec();
        parquet.extend(10_u32.to_le_bytes());
        parquet.extend(b"PAR1");
        let sealed = seal(parquet.clone());
        assert_eq!(sealed.len(), parquet.len() + SEAL_LEN);
        check(&sealed).unwrap();
        check(&parquet).unwrap_err();
        for i in 0..sealed.len() {
            let mut other = sealed.clone();
            other[i] ^= 1;
            check(&other).unwrap_err();
            check(&sealed[..i]).unwrap_err();
            other = sealed.clone();
            other.insert(i, 0);
            check(&other).unwrap_err();
        }
    }
}
