//! The answer to one request, right or with a fault.

use std::fs::File;
use std::io::{Read, Result, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::atomic::Ordering;

use super::Site;

/// The faults, and what each does.
pub const FAULTS: [(&str, &str); 25] = [
    ("whole", "sends the whole file for a range"),
    ("short", "announces all bytes, sends half of them and leaves"),
    ("less", "sends the first half of what was asked for, and says so"),
    ("more", "sends bytes beyond the range that was asked for"),
    ("shifted", "sends a range that was not asked for"),
    ("unsized", "does not tell the size of the file"),
    ("reset", "leaves without an answer"),
    ("busy", "503, try again at once"),
    ("busy-long", "503, try again in an hour"),
    ("silent", "never answers"),
    ("stalls", "sends half of the bytes and waits"),
    ("endless", "sends bytes without an end, of unknown number"),
    ("endless-head", "sends headers without an end"),
    ("changes", "the file is another one from the second request on"),
    ("swaps", "the same, and does not look at If-Range"),
    ("shrinks", "the file is empty from the second request on"),
    ("gzip", "says that the bytes are compressed"),
    ("moved", "redirects to another path of this host"),
    ("elsewhere", "redirects to another name of this host"),
    ("loop", "redirects to itself"),
    ("nowhere", "redirects without saying where to"),
    ("ftp", "redirects to another protocol"),
    ("region", "redirects to another region, as S3 does"),
    ("noise", "answers with what is no HTTP"),
    ("NUMBER", "answers with this status, such as 404"),
];

/// An answer before it is sent.
struct Answer {
    status: u16,
    headers: String,
    part: Range<u64>,
    /// How many of the bytes are sent.
    sent: u64,
}

impl Site {
    /// Answers a request of which `before` were like it. Whether the connection can go on.
    pub(crate) fn answer(&self, head: &str, before: u32, stream: &mut impl Write) -> Result<bool> {
        let mut words = head.split(' ');
        let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        let header = |name: &str| {
            let named = |line: &'_ &str| line.split_once(':').is_some_and(|(key, _)| key.eq_ignore_ascii_case(name));
            head.lines().find(named).and_then(|line| line.split_once(':')).map(|(_, value)| value.trim())
        };
        let path = path.split('?').next().unwrap_or_default().trim_start_matches('/');
        let (fault, path) = match path.strip_prefix('~').and_then(|rest| rest.split_once('/')) {
            Some((fault, rest)) => (due(fault, before), rest),
            None => ("", path),
        };
        let moved = |stream: &mut _, to: &str| plain(stream, 302, &format!("Location: {to}\r\n")).map(|()| true);
        match fault {
            "reset" => return Ok(false),
            "silent" => {
                self.silence();
                return Ok(false);
            }
            "busy" | "busy-long" => {
                let wait = if fault == "busy" { 0 } else { 3600 };
                return plain(stream, 503, &format!("Retry-After: {wait}\r\n")).map(|()| true);
            }
            "noise" => return stream.write_all(b"220 ready\r\n").map(|()| false),
            "endless-head" => {
                write!(stream, "HTTP/1.1 200 -\r\n")?;
                loop {
                    write!(stream, "X-Filler: {:.>1000}\r\n", "")?;
                }
            }
            "moved" => return moved(stream, &format!("/{path}")),
            "elsewhere" => {
                let port = header("host").and_then(|host| host.rsplit_once(':')).map_or("80", |(_, port)| port);
                return moved(stream, &format!("http://localhost:{port}/{path}"));
            }
            "loop" => return moved(stream, &format!("/~loop/{path}")),
            "nowhere" => return plain(stream, 302, "").map(|()| true),
            "ftp" => return moved(stream, &format!("ftp://localhost/{path}")),
            "region" => return plain(stream, 301, "x-amz-bucket-region: far-away-1\r\n").map(|()| true),
            _ => {}
        }
        if let Ok(status) = fault.parse() {
            return plain(stream, status, "").map(|()| true);
        }
        let place = self.0.folder.join(decoded(path));
        let inside = !path.split('/').any(|part| decoded(part) == "..");
        let Some(mut file) = inside.then(|| File::open(&place).ok()).flatten().filter(is_file) else {
            return plain(stream, 404, "").map(|()| true);
        };
        let size = if fault == "shrinks" && before > 0 { 0 } else { file.metadata()?.len() };
        let tag = if matches!(fault, "changes" | "swaps") && before > 0 { "\"second\"" } else { "\"first\"" };
        let asked = header("range").filter(|_| fault == "swaps" || header("if-range").is_none_or(|asked| asked == tag));
        let Some(answer) = arranged(fault, size, tag, asked) else {
            return plain(stream, 416, &format!("Content-Range: bytes */{size}\r\n")).map(|()| true);
        };
        write!(stream, "HTTP/1.1 {} -\r\n{}\r\n", answer.status, answer.headers)?;
        if method == "HEAD" {
            return Ok(true);
        }
        file.seek(SeekFrom::Start(answer.part.start))?;
        let mut block = vec![0; 1 << 16];
        let mut left = answer.sent;
        while left > 0 {
            let most = block.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            let mut read = file.read(&mut block[..most])?;
            if read == 0 {
                // Only what is endless goes on beyond the end of the file.
                read = most;
            }
            stream.write_all(&block[..read])?;
            self.0.bytes.fetch_add(read as u64, Ordering::Relaxed);
            left -= read as u64;
        }
        stream.flush()?;
        if fault == "stalls" {
            self.silence();
        }
        Ok(answer.sent == answer.part.end - answer.part.start && fault != "endless")
    }
}

/// The fault of `busy`, of the first three requests in `busy:3`, or of the second and third in `busy:1-3`, if it is
/// that of a request that `before` were like.
fn due(fault: &str, before: u32) -> &str {
    let Some((fault, when)) = fault.split_once(':') else { return fault };
    let (from, to) = when.split_once('-').unwrap_or(("0", when));
    let due = from.parse().is_ok_and(|from: u32| before >= from) && to.parse().is_ok_and(|to: u32| before < to);
    if due { fault } else { "" }
}

/// The answer to a request for a file, or `None` for a range that is not in it.
fn arranged(fault: &str, size: u64, tag: &str, asked: Option<&str>) -> Option<Answer> {
    let range = match asked.filter(|_| !matches!(fault, "whole" | "endless")) {
        Some(text) => {
            let (start, last) = text.strip_prefix("bytes=")?.split_once('-')?;
            let (start, last): (u64, u64) = (start.parse().ok()?, last.parse().unwrap_or(u64::MAX));
            Some(start..last.saturating_add(1).min(size)).filter(|range| range.start < range.end)?
        }
        None => 0..size,
    };
    let part = match fault {
        "less" => range.start..range.end - (range.end - range.start) / 2,
        "more" => range.start..size,
        "shifted" if range.start > 0 => range.start - 1..range.end - 1,
        "shifted" => range.start + 1..range.end,
        _ => range,
    };
    let len = part.end - part.start;
    let sent = match fault {
        "short" | "stalls" => len / 2,
        "endless" => u64::MAX,
        _ => len,
    };
    let mut headers = format!("ETag: {tag}\r\nAccept-Ranges: bytes\r\n");
    if fault == "gzip" {
        headers += "Content-Encoding: gzip\r\n";
    }
    let partial = asked.is_some() && !matches!(fault, "whole" | "endless");
    if partial {
        let whole = if fault == "unsized" { "*".to_owned() } else { size.to_string() };
        headers += &format!("Content-Range: bytes {}-{}/{whole}\r\n", part.start, part.end - 1);
    }
    headers += &match fault {
        "endless" => "Connection: close\r\n".to_owned(),
        _ => format!("Content-Length: {len}\r\n"),
    };
    Some(Answer { status: if partial { 206 } else { 200 }, headers, part, sent })
}

pub(crate) fn plain(stream: &mut impl Write, status: u16, headers: &str) -> Result<()> {
    let body = format!("<Error><Code>Status{status}</Code></Error>");
    write!(stream, "HTTP/1.1 {status} -\r\n{headers}Content-Length: {}\r\n\r\n{body}", body.len())?;
    stream.flush()
}

fn is_file(file: &File) -> bool {
    file.metadata().is_ok_and(|about| about.is_file())
}

/// A path without its percent signs.
fn decoded(path: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = path.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = tail.get(..2).filter(|_| *first == b'%').and_then(|code| std::str::from_utf8(code).ok());
        let code = code.and_then(|code| u8::from_str_radix(code, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
