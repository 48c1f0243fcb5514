//! What docs/FORMATS.md says in words. The rest of it comes from the program.

/// What stands above everything.
pub(super) const HEAD: &str = "\
# Formats

This page is made by `cargo xtask formats`. Do not edit it: edit `xtask/src/formats/words.rs`.

A file is recognised by its content first. Formats with a signature (PLY, LAS, PCD, E57 …) are read under any file
name. Formats without a signature (text, bare floats, OBJ) are recognised by their extension, in upper or lower case.
The longest extension counts: `.pcd.bin` is not `.bin`.

Every reader follows these rules:

- Positions are stored as 32-bit floats relative to an origin of whole numbers, so survey coordinates keep their
  precision. `convert` writes all digits that the output format can hold.
- Attributes keep the width of their type. Names that PDAL knows are PDAL's (`Intensity`, `Classification`, `ReturnNumber`,
  `GpsTime`, `NormalX` …); others are the file's.
- Points at exactly (0, 0, 0) are dropped and counted, because scanners write them where nothing came back. Meshes
  keep them. A single one is kept too, unless the format has the sensor there (PCD, depth images, bare floats).
- Points with NaN or infinite coordinates stay in the cloud, but are not drawn.
- The program says on standard error what it lost, guessed, dropped or scaled. `info` lists the same in `warnings`.
- Counts in a header are checked against the file's size before memory is allocated. A broken file ends in one line:
  the file, the place, what is wrong and what to do.
";

/// What is kept of a format, and what is not.
pub(super) struct Words {
    pub(super) name: &'static str,
    pub(super) kept: &'static str,
    pub(super) not_kept: &'static str,
}

/// Of each format that may be read or written.
pub(super) const WORDS: &[Words] = &[
    Words {
        name: "LAS",
        kept: "LAS 1.0 to 1.4, LAZ and COPC; point formats 0 to 10; coordinates, colours, all attributes, extra \
               bytes, units and coordinate system; the scale, as resolution",
        not_kept: "waveforms; the octree of COPC (all points are read)",
    },
    Words {
        name: "PLY",
        kept: "text, and binary in both byte orders; all scalar properties of `vertex`, colours; faces, for `convert \
               --sample`",
        not_kept: "list properties of points, other elements",
    },
    Words {
        name: "PCD",
        kept: "text, binary and compressed; fields of up to 16 values; colours, packed into `rgb` or `rgba` or in \
               fields of their own; the viewpoint, as sensor position. Without a viewpoint, the sensor of an \
               organised cloud is at the origin if the rays of its pixels meet there",
        not_kept: "the grid of organised clouds",
    },
    Words {
        name: "text",
        kept: "columns separated by blanks, commas, semicolons or tabs, with or without a header. Their meaning is \
               guessed from names or values; `--columns` states it",
        not_kept: "columns of words, comments",
    },
    Words {
        name: "PTX",
        kept: "all scans, moved to world coordinates by their matrices; sensor positions, intensity, colours",
        not_kept: "the grid of each scan",
    },
    Words {
        name: "E57",
        kept: "all scans, cartesian and spherical, moved to world coordinates by their poses; sensor positions, \
               intensity, colours, row and column, fields of extensions. Z is up, except in clouds smaller than one \
               metre without a sensor position",
        not_kept: "embedded pictures",
    },
    Words {
        name: "bare floats",
        kept: "little-endian 32-bit floats without a header: x y z intensity (KITTI), x y z intensity ring \
               (nuScenes), or the columns that `--columns` states",
        not_kept: "",
    },
    Words {
        name: "depth image",
        kept: "16-bit PNG and PGM; the camera is stated by `--depth-camera` or by a file beside the image, colours \
               by a picture beside it",
        not_kept: "",
    },
    Words {
        name: "OBJ",
        kept: "vertices with colours; faces, for `convert --sample`",
        not_kept: "normals (OBJ stores them for corners of faces); materials, textures",
    },
    Words { name: "OFF", kept: "vertices with colours and normals; faces, for `convert --sample`", not_kept: "" },
    Words {
        name: "STL",
        kept: "text and binary; corners, as points; faces, for `convert --sample`",
        not_kept: "attribute bytes",
    },
    Words {
        name: "glTF",
        kept: "GLB and glTF, with buffers embedded or in files beside it; points and meshes of the scene, in world \
               coordinates; colours, normals; faces, for `convert --sample`",
        not_kept: "materials, textures; animation, except where the file is played (`view`, `render --frames`)",
    },
];

/// What stands before the table of files.
pub(super) const FILES: &str = "\
## Test files

The table lists the test data beside the repository; a README there names the sources. Points and bounds are those of
`info --scan`. *Rendered* says whether `render` makes a picture of the file.
";
