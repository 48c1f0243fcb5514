//! Object stores with a server of one's own.

use autosplats_remote::{Credentials, RemoteOptions, Secret};

use crate::{Site, bytes, open, open_folder, part, quick};

#[test]
fn buckets_are_read_signed_or_not() {
    let site = Site::new();
    site.add("bucket/a folder/scan", &bytes(0..100_000));
    let endpoint = site.server.address("").trim_end_matches('/').to_owned();
    let open_one = RemoteOptions { s3_endpoint: Some(endpoint), ..quick() };
    let credentials =
        Credentials { key: "ID".into(), secret: Secret("hidden".into()), token: Some(Secret("token".into())) };
    let signed = RemoteOptions { credentials: Some(credentials), ..open_one.clone() };
    for options in [&open_one, &signed] {
        let file = open("s3://bucket/a folder/scan", options, &()).unwrap();
        assert_eq!(file.name().to_str().unwrap(), "s3://bucket/a folder/scan");
        assert_eq!(part(&*file, 70_000..70_100).unwrap(), bytes(70_000..70_100));
        let folder = open_folder("s3://bucket/a folder/", options).unwrap();
        assert_eq!(folder.read(&["scan".to_owned()], 100_000, &()).unwrap(), [bytes(0..100_000)]);
    }
    let heads = site.server.heads();
    assert!(heads[..3].iter().all(|head| head.starts_with("GET /bucket/a%20folder/scan HTTP")), "{heads:?}");
    for head in &heads[3..] {
        assert!(head.starts_with("GET /bucket/a%20folder/scan?X-Amz-Algorithm=AWS4-HMAC-SHA256"), "{head}");
        assert!(head.contains("X-Amz-Security-Token=token") && head.contains("&X-Amz-Signature="), "{head}");
    }
    let told = open("s3://bucket/none", &signed, &()).unwrap_err().to_string();
    let what = "the server answers 404, Status404: there is no such file; check the address";
    assert_eq!(told, format!("s3://bucket/none: {what}"), "without the signature");
}
