//! Logs at an address, `http://`, `https://` or `s3://`. Only the needed parts of an MCAP with an index are
//! fetched; any other file is copied as a whole into the folder for temporary files.

use super::contents::{Format, LogError};
use super::mcap::Source;
use super::text::HEAD;
use object_store::aws::AmazonS3Builder;
use object_store::http::HttpBuilder;
use object_store::path::Path as Location;
use object_store::{
    ClientOptions, Error, GetOptions, GetRange, ObjectStore, ObjectStoreExt, Result, RetryConfig,
};
use std::fs::File;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};

/// A server that sends nothing for this long is not there.
const SILENCE: Duration = Duration::from_secs(30);
const CONNECTING: Duration = Duration::from_secs(10);
const RETRIES: usize = 2;
/// Copies are fetched in pieces of this many bytes.
const PIECE: u64 = 16 << 20;

/// A log at an address.
pub(super) enum Remote {
    /// The log is on this machine.
    No,
    /// The log was copied into a folder, which is deleted with this value.
    Copied { _folder: tempfile::TempDir },
    /// The log is read at its address.
    Read(Object),
}

/// The object at an address.
pub(super) struct Object {
    store: Box<dyn ObjectStore>,
    location: Location,
    runtime: Runtime,
    size: u64,
}

/// Opens an address: the path of its copy, its format, and the kind of access.
pub(super) fn reached(address: &str) -> std::result::Result<(PathBuf, Format, Remote), LogError> {
    let failed = |e: String| LogError::of_file(address, "address", e);
    let runtime = Builder::new_current_thread().enable_all().build().map_err(|e| failed(e.to_string()))?;
    let (store, location) = store(address).map_err(|e| failed(shown(&e, address)))?;
    let range = GetOptions { range: Some(GetRange::Bounded(0..HEAD as u64)), ..GetOptions::default() };
    let asked = runtime.block_on(async {
        let result = store.get_opts(&location, range).await?;
        Ok((result.meta.size, result.bytes().await?))
    });
    let (size, head) = match asked {
        Ok((size, head)) => (size, Some(head)),
        // A server that does not know of ranges sends all of it.
        Err(Error::Generic { .. } | Error::NotSupported { .. }) => (0, None),
        Err(e) => return Err(failed(shown(&e, address))),
    };
    let mut object = Object { store, location, runtime, size };
    if head.is_some_and(|head| Format::of(&head) == Format::Mcap) {
        return Ok((address.into(), Format::Mcap, Remote::Read(object)));
    }
    let folder = tempfile::tempdir().map_err(|e| failed(e.to_string()))?;
    // An array is called by its file's name.
    let path = folder.path().join(object.location.filename().unwrap_or("log"));
    object.copy(&path, address).map_err(|e| failed(e.to_string()))?;
    let format = Format::of_file(&path).map_err(|LogError(mut reasons)| {
        reasons.iter_mut().for_each(|reason| reason.file = address.to_string());
        LogError(reasons)
    })?;
    Ok((path, format, Remote::Copied { _folder: folder }))
}

fn store(address: &str) -> Result<(Box<dyn ObjectStore>, Location)> {
    let (scheme, rest) = address.split_once("://").unwrap_or_default();
    // Its query belongs to the server, and may be what lets one in.
    let (rest, query) = if scheme == "s3" { (rest, "") } else { rest.split_once('?').unwrap_or((rest, "")) };
    let (host, path) = rest.split_once('/').unwrap_or((rest, ""));
    let location = Location::from_url_path(path)?;
    let retry = RetryConfig { max_retries: RETRIES, retry_timeout: SILENCE, ..RetryConfig::default() };
    let options = ClientOptions::new()
        .with_timeout_disabled()
        .with_connect_timeout(CONNECTING)
        .with_read_timeout(SILENCE);
    if scheme == "s3" {
        let http = std::env::var("AWS_ALLOW_HTTP").is_ok_and(|value| value == "true");
        let builder = AmazonS3Builder::from_env().with_bucket_name(host).with_retry(retry);
        let store = builder.with_client_options(options.with_allow_http(http)).build()?;
        return Ok((Box::new(store), location));
    }
    let query = if query.is_empty() { String::new() } else { format!("?{query}") };
    let builder = HttpBuilder::new().with_url(format!("{scheme}://{host}/{query}")).with_retry(retry);
    let store = builder.with_client_options(options.with_allow_http(scheme == "http")).build()?;
    Ok((Box::new(store), location))
}

/// Why an address was not reached, and what to do.
fn shown(error: &Error, address: &str) -> String {
    let set = |name: &str| std::env::var_os(name).is_some();
    let known = ["AWS_ACCESS_KEY_ID", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_SKIP_SIGNATURE"];
    let hint = match error {
        Error::NotFound { .. } => "there is no such file",
        Error::Unauthenticated { .. } | Error::PermissionDenied { .. } => "access is denied",
        _ => "cannot be reached",
    };
    let advice = match address.starts_with("s3://") && !known.into_iter().any(set) {
        true => {
            "; there are no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or \
             AWS_SKIP_SIGNATURE=true for a public bucket"
        }
        false => "",
    };
    format!("{hint}: {}{advice}", innermost(error))
}

/// The cause behind all that wraps it.
fn innermost(error: &Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

impl Object {
    /// Copies all of it.
    fn copy(&mut self, path: &std::path::Path, address: &str) -> io::Result<()> {
        let mut out = File::create(path)?;
        if self.size == 0 {
            let all = self.runtime.block_on(async { self.store.get(&self.location).await?.bytes().await });
            return out.write_all(&all.map_err(|e| io::Error::other(shown(&e, address)))?);
        }
        let mut from = 0;
        while from < self.size {
            let piece = self.range(from, PIECE)?;
            out.write_all(&piece)?;
            from += piece.len() as u64;
        }
        Ok(())
    }
}

impl Source for Object {
    fn length(&mut self) -> io::Result<u64> {
        Ok(self.size)
    }

    fn range(&mut self, from: u64, length: u64) -> io::Result<Vec<u8>> {
        let range = from.min(self.size)..from.saturating_add(length).min(self.size);
        if range.is_empty() {
            return Ok(Vec::new());
        }
        let bytes = self.runtime.block_on(self.store.get_range(&self.location, range));
        bytes.map(Into::into).map_err(|e| io::Error::other(innermost(&e)))
    }
}
