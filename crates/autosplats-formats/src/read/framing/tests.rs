//! Streams of files in pieces of every size, cut anywhere, with garbage and false claims in them.

use super::*;

fn pcd(encoding: &str, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n\
         DATA {encoding}\n"
    );
    [header.as_bytes(), body].concat()
}

fn ply(format: &str, end: &str, faces: usize, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply{end}format {format} 1.0{end}element vertex 2{end}property float x{end}property float y{end}\
         property float z{end}element face {faces}{end}property list uchar int vertex_indices{end}end_header{end}"
    );
    [header.as_bytes(), body].concat()
}

/// One file of each kind that a stream may contain.
fn files() -> Vec<Vec<u8>> {
    let points: Vec<u8> = (0..6).flat_map(|value| (value as f32).to_le_bytes()).collect();
    let big: Vec<u8> = (0..6).flat_map(|value| (value as f32).to_be_bytes()).collect();
    let faces = |one: [u8; 4]| [&points, &[3][..], &[one, one, one].concat(), &[0], &[1], &one].concat();
    let packed = [&25_u32.to_le_bytes()[..], &24_u32.to_le_bytes(), &[23], &points].concat();
    vec![
        ply("ascii", "\n", 1, b"0 0 0\n\n1 1 1\n3 0 1 1\n"),
        ply("binary_little_endian", "\n", 3, &faces(1_i32.to_le_bytes())),
        pcd("ascii", b"0 0 0\n# a comment\n1 1 1\n"),
        pcd("binary", &points),
        ply("binary_big_endian", "\r\n", 0, &big),
        pcd("binary_compressed", &packed),
        ply("binary_little_endian", "\r", 0, &points),
        pcd("binary", &points).split_off(12),
    ]
}

/// The findings if bytes arrive in pieces of size `piece`.
fn found(bytes: &[u8], piece: usize) -> Vec<Found> {
    let mut framing = Framing::new(1 << 20);
    let mut all = Vec::new();
    for piece in bytes.chunks(piece) {
        framing.push(piece);
        all.extend(std::iter::from_fn(|| framing.find()));
    }
    all.extend(framing.end());
    assert!(framing.end().is_none() && framing.find().is_none(), "the end is told once");
    all
}

fn whole(found: &[Found]) -> Vec<&[u8]> {
    found.iter().filter_map(|found| if let Found::File(_, bytes) = found { Some(&**bytes) } else { None }).collect()
}

fn refused(found: &[Found]) -> Vec<(u64, &str)> {
    let refused = |found| if let &Found::Refused(byte, ref what) = found { Some((byte, &**what)) } else { None };
    found.iter().filter_map(refused).collect()
}

#[test]
fn files_of_every_kind_are_found_in_pieces_of_any_size() {
    let files = files();
    let stream = files.concat();
    for piece in [1, 2, 3, 7, 64, 1000, stream.len()] {
        let found = found(&stream, piece);
        assert_eq!(whole(&found), files, "in pieces of {piece}");
        assert_eq!(found.len(), files.len(), "and nothing else");
    }
    let mut at = 0;
    for (found, file) in found(&stream, 5).iter().zip(&files) {
        assert!(matches!(found, Found::File(start, _) if *start == at), "where each begins");
        at += file.len() as u64;
    }
}

#[test]
fn a_stream_cut_anywhere_gives_the_files_before_the_cut() {
    let files = files();
    let stream = files.concat();
    let ends: Vec<usize> = files
        .iter()
        .scan(0, |end, file| {
            *end += file.len();
            Some(*end)
        })
        .collect();
    for cut in 0..stream.len() {
        let found = found(&stream[..cut], 64);
        let before = ends.iter().filter(|&&end| end <= cut).count();
        // Without its line feed, the last line of a text may be incomplete.
        let last = stream[..cut].iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let in_text = stream[last..].iter().position(|&byte| byte == b'\n').map(|len| last + len + 1);
        let without_feed = in_text.is_some_and(|end| ends.contains(&end)) && whole(&found).len() == before + 1;
        assert!(whole(&found).len() == before || without_feed, "cut at {cut}");
        let rest = !without_feed && cut > ends[..before].last().copied().unwrap_or(0);
        assert_eq!(refused(&found).len(), usize::from(rest), "cut at {cut}: {:?}", refused(&found));
    }
}

#[test]
fn what_is_no_file_is_told_once_and_skipped() {
    let files = files();
    let binary: Vec<u8> = (1..2000_u32).flat_map(|i| i.wrapping_mul(0x9E37_79B9).to_be_bytes()).collect();
    for garbage in [&b"x"[..], b"hello\nply or not\n", b"pl", b"VERSIO", &[1; 40], &binary] {
        for file in &files[..7] {
            let stream = [file, garbage, &files[3], &files[0]].concat();
            for piece in [1, 17, stream.len()] {
                let found = found(&stream, piece);
                assert_eq!(whole(&found), [file, &files[3], &files[0]], "{:?} in pieces of {piece}", excerpt(garbage));
                let refused = refused(&found);
                assert_eq!((refused.len(), refused[0].0), (1, file.len() as u64), "once, with its byte");
            }
        }
    }
}

#[test]
fn zeros_between_files_are_nothing() {
    let files = files();
    for file in &files[..7] {
        let stream = [&file[..], &[0; 3906], &files[3], &[0; 40]].concat();
        for piece in [1, 17, stream.len()] {
            let found = found(&stream, piece);
            assert_eq!((whole(&found), refused(&found).len()), (vec![&file[..], &files[3]], 0), "in pieces of {piece}");
        }
    }
    let found = found(&[0; 4000], 1000);
    assert_eq!(refused(&found).len(), 1, "a stream of nothing else is refused");
}

#[test]
fn headers_that_lie_are_refused_before_their_bytes_have_come() {
    let good = files().swap_remove(3);
    let with = |from: &str, to: &str| {
        let text = String::from_utf8_lossy(&pcd("binary", b"")).replace(from, to);
        [text.as_bytes(), &good].concat()
    };
    let faces = |count: &str| {
        ply("binary_little_endian", "\n", 0, b"")
            .iter()
            .map(|&byte| byte as char)
            .collect::<String>()
            .replace("face 0", count)
    };
    let vast = faces("face 18446744073709551615");
    let cases = [
        (with("POINTS 2", "POINTS 357913942"), "4294967"),
        (with("POINTS 2", "POINTS 18446744073709551615"), "announces more"),
        (with("COUNT 1 1 1", "COUNT 9999999999999999999 1 1"), "announces more"),
        (with("COUNT 1 1 1", "COUNT 1 1 -1"), "'-1' is invalid"),
        (with("DATA binary", "DATA ternary"), "unknown DATA"),
        ([pcd("ascii", b"0 0 0\n"), good.clone()].concat(), "1 lines of points are missing"),
        ([vast.as_bytes(), &good].concat(), "announces more"),
    ];
    for (stream, says) in cases {
        let found = found(&stream, 11);
        assert_eq!(whole(&found), [&*good], "what follows is read: {says}");
        assert!(matches!(refused(&found)[..], [(0, what)] if what.contains(says)), "{says}: {:?}", refused(&found));
    }
    let endless = [b"# .PCD v0.7\n".repeat(100_000), good.clone()].concat();
    assert_eq!(refused(&found(&endless, 1 << 16)).len(), 1, "a header without end");
}

#[test]
fn byte_order_marks_before_files_are_skipped() {
    let file = ply("ascii", "\n", 0, b"0 0 0\n1 1 1\n");
    let stream = [b"\xef\xbb\xbf", &file[..], b"\n\xef\xbb\xbf", &file[..]].concat();
    for piece in [1, 2, 5, stream.len()] {
        let all = found(&stream, piece);
        assert!(all.iter().all(|found| matches!(found, Found::File(_, bytes) if *bytes == file)), "pieces of {piece}");
        assert_eq!(all.len(), 2, "pieces of {piece}");
    }
}
