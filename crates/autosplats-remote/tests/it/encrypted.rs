//! Encrypted connections.

use std::net::TcpListener;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use autosplats_remote::RemoteOptions;
use autosplats_serve::Site;
use rcgen::{CertifiedKey, generate_simple_self_signed};
use rustls::pki_types::PrivateKeyDer;
use rustls::{ServerConfig, ServerConnection, StreamOwned};

use crate::{bytes, open, part, quick};

/// Names the address that the test opens when it runs as its own child.
const ADDRESS: &str = "AUTOSPLATS_TEST_ADDRESS";

#[test]
fn certificates_must_be_trusted() {
    if let Ok(address) = std::env::var(ADDRESS) {
        let file = open(&address, &quick(), &()).unwrap();
        assert_eq!(file.size(), 200_000);
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a"), bytes(0..200_000)).unwrap();
    let CertifiedKey { cert, signing_key } = generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let key = PrivateKeyDer::try_from(signing_key.serialize_der()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let config = Arc::new(config.with_no_client_auth().with_single_cert(vec![cert.der().clone()], key).unwrap());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let site = Site::new(folder.path().into(), Duration::ZERO, false);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let (site, config) = (site.clone(), config.clone());
            std::thread::spawn(move || {
                let encrypted = StreamOwned::new(ServerConnection::new(config).unwrap(), stream.unwrap());
                site.converse(encrypted)
            });
        }
    });
    let trusting = RemoteOptions { authorities: Some(vec![cert.der().to_vec()]), ..quick() };
    let address = |host: &str| format!("https://{host}:{port}/a");
    let file = open(&address("localhost"), &trusting, &()).unwrap();
    assert_eq!(part(&*file, 100_000..100_100).unwrap(), bytes(100_000..100_100));

    let remedy = "a private authority must be one of the system's, or in the file that SSL_CERT_FILE names";
    let untrusted = |why: &str| format!("the server's certificate is not trusted: {why}; {remedy}");
    let fault = |host: &str, options: &RemoteOptions| {
        let told = open(&address(host), options, &()).unwrap_err().to_string();
        told.strip_prefix(&format!("{}: ", address(host))).unwrap().to_owned()
    };
    assert_eq!(fault("127.0.0.1", &trusting), untrusted("it is for another host"));
    let nobody = RemoteOptions { authorities: Some(Vec::new()), ..quick() };
    assert_eq!(fault("localhost", &nobody), untrusted("no authority known here has issued it"));
    // With the system's authorities, if there are any.
    assert!(fault("localhost", &quick()).contains("certificate"), "{}", fault("localhost", &quick()));
    // Other systems have no variable for it.
    if cfg!(target_os = "linux") {
        let (file, mut child) = (folder.path().join("pem"), Command::new(std::env::current_exe().unwrap()));
        std::fs::write(&file, cert.pem()).unwrap();
        child.args(["--exact", "encrypted::certificates_must_be_trusted"]);
        let outcome = child.env("SSL_CERT_FILE", file).env(ADDRESS, address("localhost")).output().unwrap();
        assert!(outcome.status.success(), "{outcome:?}");
    }

    let plain = crate::Site::new();
    let told = open(&plain.server.address("a").replace("http:", "https:"), &trusting, &()).unwrap_err().to_string();
    assert!(told.contains("no encrypted connection: ") && told.ends_with("which may be an http:// one"), "{told}");
}
