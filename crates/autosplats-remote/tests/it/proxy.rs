//! Requests through a proxy.

use std::io::{BufRead as _, BufReader, Write as _, copy};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use autosplats_remote::{Proxies, RemoteOptions};

use crate::{Site, bytes, open, part, quick};

/// A proxy that leads all to one server, or answers with a status. Gives its port and the heads it gets.
fn proxy(server: String, status: u16) -> (u16, Receiver<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (sender, heads) = channel();
    thread::spawn(move || {
        for stream in listener.incoming() {
            let mut near = stream.unwrap();
            let (mut reader, mut head) = (BufReader::new(near.try_clone().unwrap()), String::new());
            while !head.ends_with("\r\n\r\n") && reader.read_line(&mut head).unwrap() > 0 {}
            sender.send(head).unwrap();
            write!(near, "HTTP/1.1 {status} -\r\n\r\n").unwrap();
            if status == 200 {
                let far = TcpStream::connect(&server).unwrap();
                let (mut from, mut to) = (near.try_clone().unwrap(), far.try_clone().unwrap());
                thread::spawn(move || copy(&mut from, &mut to).and_then(|_| to.shutdown(Shutdown::Both)));
                thread::spawn(move || copy(&mut &far, &mut &near).and_then(|_| near.shutdown(Shutdown::Both)));
            }
        }
    });
    (port, heads)
}

fn through(value: String) -> RemoteOptions {
    let proxies = Proxies::from_variables(&|name| (name == "HTTP_PROXY").then(|| value.clone()));
    RemoteOptions { proxies, ..quick() }
}

#[test]
fn proxies_are_asked_to_connect() {
    let site = Site::new();
    let server = site.server.address("").trim_start_matches("http://").trim_end_matches('/').to_owned();
    let (port, heads) = proxy(server.clone(), 200);
    let options = through(format!("http://me:secret@127.0.0.1:{port}"));
    let file = open("http://scans.invalid/scan.laz", &options, &()).unwrap();
    assert_eq!(part(&*file, 500_000..500_100).unwrap(), bytes(500_000..500_100));
    let head = heads.recv().unwrap();
    assert!(head.starts_with("CONNECT scans.invalid:80 HTTP/1.1\r\n"), "{head}");
    assert!(head.contains("Proxy-Authorization: Basic bWU6c2VjcmV0\r\n"), "{head}");
    assert!(heads.try_recv().is_err(), "the connection is used again");
    open(&site.server.address("scan.laz"), &options, &()).unwrap();
    assert!(heads.try_recv().is_err(), "this machine is reached directly");
}

#[test]
fn faults_of_proxies_name_them() {
    let fault = |value: String| {
        let told = open("http://scans.invalid/a", &through(value), &()).unwrap_err().to_string();
        told.strip_prefix("http://scans.invalid/a: ").unwrap().to_owned()
    };
    for (status, remedy) in [(407, "put name and password into that variable"), (403, "ask its owner")] {
        let (port, _heads) = proxy(String::new(), status);
        let told = fault(format!("http://127.0.0.1:{port}"));
        let what = format!("does not let it through (proxy server responded {status}/{status}); {remedy}");
        assert_eq!(told, format!("the proxy of HTTP_PROXY, 127.0.0.1, port {port} {what}"));
    }
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let told = fault(format!("http://me:secret@127.0.0.1:{closed}"));
    let peer = format!("the proxy of HTTP_PROXY, 127.0.0.1, port {closed}");
    assert_eq!(told, format!("nobody answers at {peer}; check the address, and that the server runs"));
    let wrong = fault("gopher://me:secret@x".into());
    assert_eq!(wrong, "HTTP_PROXY is no address of a proxy, such as http://host:8080; set it anew");
}
