//! Real scans, and files that broke other programs. They may not be redistributed, so they lie beside the repository.

use std::fs::read_dir;

use crate::common::{Folder, data};

#[test]
fn scans_become_pictures() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    for name in [
        "models/bunny.ply",
        "models/guanyin_color.ply",
        "models/igea.ply",
        "models/armadillo_normals.ply",
        "scans/autzen_trim.laz",
        "scans/simple_1065.las",
        "scans/lion_takanawa.copc.laz",
        "scans/five_people.pcd",
        "scans/livingroom_fragment.pcd",
        "scans/rops_ascii.pcd",
        "scans/isprs_samp11_utm_f32.pcd",
        "scans/bunny.pts",
        "sequences/kitti_drive_pcd/000000.pcd",
        "multiview/bunny_scans/bun000.ply",
    ] {
        let path = data.join(name);
        let input = path.to_str().expect("the folder's name is UTF-8");
        folder.succeed(&["render", input, "-o", "out.png", "--size", "320x200", "--quiet"]);
    }
}

#[test]
fn hostile_files_end_in_a_line() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    for entry in read_dir(data.join("malformed")).expect("the folder can be read") {
        let path = entry.expect("the folder can be read").path();
        let input = path.to_str().expect("the folder's name is UTF-8");
        let outcome = folder.run(&["render", input, "-o", "out.png", "--size", "64x64", "--quiet"]);
        let lines = outcome.stderr.lines().count();
        match outcome.code {
            Some(0) => assert_eq!(lines, 0, "{input}: {}", outcome.stderr),
            Some(3) => assert_eq!([lines, folder.list().len()], [1, 0], "{input}: {}", outcome.stderr),
            code => panic!("{input}: {code:?}: {}", outcome.stderr),
        }
        let _ = std::fs::remove_file(folder.path("out.png"));
    }
}
