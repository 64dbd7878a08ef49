//! Files that appear whole or not at all.

use std::io::Write;
use std::path::Path;

use crate::Error;

/// Writes `bytes` to a hidden temporary file beside `path`, syncs it and gives it its name, replacing what was there.
/// The folder must exist.
pub(crate) fn publish(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".figure.").suffix(".partial");
    #[cfg(unix)]
    {
        // As any other new file, less the umask; the default lets only the owner read.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(Error::io("create a temporary file in", folder))?;
    file.write_all(bytes).map_err(Error::io("write", file.path()))?;
    file.as_file().sync_all().map_err(Error::io("sync", file.path()))?;
    file.persist(path).map_err(|e| Error::io("publish", path)(e.error))?;
    #[cfg(unix)]
    std::fs::File::open(folder).and_then(|f| f.sync_all()).map_err(Error::io("sync the folder", folder))?;
    Ok(())
}
