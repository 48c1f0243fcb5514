//! What docs/FORMATS.md says in words. The rest of it comes from the program.

/// What stands above everything.
pub(super) const HEAD: &str = "\
# Formats

Made by `cargo xtask formats`; changes here are lost.

A file is recognised by its content first: formats that begin with a mark of their own (PLY, LAS, PCD, E57 …) are read
whatever the file is called. Formats without one (text, bare numbers, OBJ) go by the extension, letter case ignored; of
two extensions the longer one counts, so `.pcd.bin` is not `.bin`.

What every reader does:

- Positions are kept as 32-bit floats about an origin of whole numbers, so that survey coordinates lose nothing that
  matters; `convert` reads all digits and writes them again.
- Attributes keep their width. Their names are PDAL's where PDAL knows them (`Intensity`, `Classification`,
  `ReturnNumber`, `GpsTime`, `NormalX` …), else the file's.
- Points at exactly (0, 0, 0), which scanners write where nothing came back, are dropped and counted; points that are no
  numbers are kept in the cloud and left out of pictures.
- What is lost, guessed, dropped or scaled is said on standard error, and by `info` in its `warnings`.
- What a header claims is compared with the size of the file before any memory is taken. Broken files end in one line:
  the file, the place, what is wrong and what can be done.
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
        kept: "LAS 1.0 to 1.4, LAZ and COPC, point formats 0 to 10: coordinates, colours, all attributes, extra bytes, units \
               and coordinate system, scale as resolution",
        not_kept: "waveforms; of COPC the tree, as all points are read",
    },
    Words {
        name: "PLY",
        kept: "text and binary of both byte orders; all scalar properties of `vertex`, colours; faces for `convert --sample`",
        not_kept: "list properties of points, other elements",
    },
    Words {
        name: "PCD",
        kept: "text, binary and compressed; fields of up to 16 values, colours packed into `rgb` or `rgba` or apart, the \
               viewpoint as the sensor's place, the origin for organised clouds whose rays meet there",
        not_kept: "the grid of organised clouds",
    },
    Words {
        name: "text",
        kept: "columns between blanks, commas, semicolons or tabs, with or without names; meanings are guessed from names \
               or values, `--columns` states them",
        not_kept: "words and comments",
    },
    Words {
        name: "PTX",
        kept: "all scans, placed by their matrices; sensor positions, intensity, colours",
        not_kept: "the grid of each scan",
    },
    Words {
        name: "E57",
        kept: "all scans, cartesian and spherical, placed by their poses; sensor positions, intensity, colours, row and \
               column, fields of extensions; Z is up, but for things of less than a metre without a sensor's position",
        not_kept: "embedded pictures",
    },
    Words {
        name: "bare floats",
        kept: "little-endian 32-bit floats without a header: x y z and intensity (KITTI), ring (nuScenes); `--columns` \
               states others",
        not_kept: "",
    },
    Words {
        name: "depth image",
        kept: "16-bit PNG and PGM, through the camera that is stated or lies beside them",
        not_kept: "",
    },
    Words {
        name: "OBJ",
        kept: "vertices with colours; faces for `convert --sample`",
        not_kept: "normals, which belong to corners of faces; materials, textures",
    },
    Words { name: "OFF", kept: "vertices with colours and normals; faces for `convert --sample`", not_kept: "" },
    Words {
        name: "STL",
        kept: "text and binary; corners as points; faces for `convert --sample`",
        not_kept: "attribute bytes",
    },
    Words {
        name: "glTF",
        kept: "GLB and glTF with embedded or neighbouring buffers: points and meshes of the scene, placed; colours, normals; faces for `convert --sample`",
        not_kept: "materials, textures, animation",
    },
];

/// What stands before the table of files.
pub(super) const FILES: &str = "\
## Files it was tried on

The test data beside the repository; their README says where they are from. Points and bounds are as `info --scan` counts
them. A file is rendered if `render` makes a picture of it.
";
