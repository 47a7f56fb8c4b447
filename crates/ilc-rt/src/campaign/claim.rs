//! The claim to a campaign: two programs must not continue the same one.
//!
//! A name in the kernel's abstract socket namespace, which is released the moment its owner ends,
//! however it ends: no file is left behind that could outlive a killed process.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::Path;

use super::error::{CampaignError, ResumeError};
use crate::record::fingerprint;

/// Held while the campaign runs; without a socket if the system has none left.
#[derive(Debug)]
pub(super) struct Claim {
    _socket: Option<UnixListener>,
}

impl Claim {
    /// Claims nothing.
    pub(super) fn none() -> Self {
        Self { _socket: None }
    }
}

/// Claims a campaign of a library.
///
/// # Errors
/// [`CampaignError::Resume`] if another program holds it.
pub(super) fn claim(library: &Path, campaign: &str) -> Result<Claim, CampaignError> {
    // A library in memory has no file, and no other program can open it.
    let Ok(file) = std::fs::metadata(library) else { return Ok(Claim::none()) };
    let name = fingerprint(&format!("{} {} {campaign}", file.dev(), file.ino()));
    let name = format!("ilc-rt/campaign/{}", name.get(..32).unwrap_or(&name));
    let socket =
        SocketAddr::from_abstract_name(name).and_then(|address| UnixListener::bind_addr(&address));
    match socket {
        Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => {
            let (campaign, library) = (campaign.to_owned(), library.to_owned());
            Err(ResumeError::Claimed { campaign, library }.into())
        }
        // A failure for any other reason must not block the campaign.
        socket => Ok(Claim { _socket: socket.ok() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_campaign_has_one_owner_at_a_time() {
        let library = std::env::temp_dir().join(format!("ilc-claim-{}", std::process::id()));
        std::fs::write(&library, "").unwrap();
        let held = claim(&library, "a").unwrap();
        let refused = claim(&library, "a").unwrap_err().to_string();
        assert!(refused.contains("campaign a of ") && refused.ends_with("in another program"));
        assert!(claim(&library, "b").is_ok(), "another campaign of the same library");
        drop(held);
        assert!(claim(&library, "a").is_ok());
        std::fs::remove_file(&library).unwrap();
        assert!(claim(Path::new(":memory:"), "a").is_ok());
    }
}
