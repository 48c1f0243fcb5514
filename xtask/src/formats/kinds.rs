//! Kinds of faults that files have, and what becomes of each.

/// Start of the section.
pub(super) const KINDS_TEXT: &str = "\
## Faults

Each kind has one rule, which all formats share that can have it. *Told* means a note of one line and exit code 0.
*Refused* means an error of one line that names the file, the position and the remedy.
";

/// A kind of fault.
pub(super) struct Kind {
    pub(super) fault: &'static str,
    pub(super) outcome: &'static str,
}

/// All kinds, in the order of the document.
pub(super) const KINDS: &[Kind] = &[
    Kind {
        fault: "bare floats without a header",
        outcome: "their values tell how many floats a point has, 3 to 8; what they do not tell is refused, with `--columns` as remedy",
    },
    Kind { fault: "a first column of point numbers, columns of words", outcome: "left out, told" },
    Kind {
        fault: "rows of unequal length",
        outcome: "refused, unless a header names a list as COLMAP's does, or `--columns` ends in `...`",
    },
    Kind {
        fault: "a few colour values beyond full brightness",
        outcome: "nearly all values tell the scale; the few are clipped, told",
    },
    Kind {
        fault: "a constant field",
        outcome: "one colour: a range below a few steps of the values' own precision is none",
    },
    Kind {
        fault: "64-bit fields far from zero",
        outcome: "stored and coloured relative to their median; legends tell their ends apart",
    },
    Kind {
        fault: "degrees, by names, coordinate system or values",
        outcome: "shown as metres on the ground with all digits; if the values alone say so, told",
    },
    Kind {
        fault: "heights in another unit than x and y",
        outcome: "brought to the unit of x and y in everything that follows, told",
    },
    Kind { fault: "clusters far apart", outcome: "dots, where a sample of the points hits hardly any pixels" },
    Kind {
        fault: "colours packed into a column `rgb` or `rgba` of PCD or PLY",
        outcome: "unpacked; in text a point or an exponent makes it the float whose bits are the colour",
    },
    Kind {
        fault: "a byte order mark, UTF-16 with a mark",
        outcome: "read in every text and header, in poses and cameras too",
    },
    Kind {
        fault: "OBJ lines of seven numbers",
        outcome: "colours are the 4th to 6th; a 4th number of 1 throughout is a weight",
    },
    Kind {
        fault: "an ESRI ASCII grid under any name",
        outcome: "a point at each cell's centre, z up; cells without data are left out, told",
    },
    Kind {
        fault: "E57 whose XML is not well formed, or short by its last checksum",
        outcome: "repaired where the meaning is clear, told; else refused",
    },
    Kind {
        fault: "a fault, or an unreadable pose, in one scan of several",
        outcome: "that scan is left out, or stands unmoved; told by its name",
    },
    Kind { fault: "LAZ without a usable chunk table", outcome: "chunks are found one after the other, told" },
    Kind {
        fault: "LAS whose count is 0, or smaller than what is there",
        outcome: "with a count of 0 all whole records are read, else the stated number; told",
    },
    Kind {
        fault: "thousands separators, decimal commas, quoted values",
        outcome: "the notation of all numbers decides; ambiguous ones are refused",
    },
    Kind {
        fault: "rows without coordinates (NULL, N/A, -, nothing)",
        outcome: "skipped and counted; refused if half of the rows or more are so",
    },
    Kind { fault: "heights of -9999 and the like, far below all others", outcome: "left out, told" },
    Kind { fault: "words before or after the rows", outcome: "skipped, told; between the rows they are an error" },
    Kind {
        fault: "column names in other languages, Northing first, compound names",
        outcome: "x is east and y is north whatever the order; one list of names serves all formats; a missing z is an error",
    },
    Kind {
        fault: "3D Gaussian splats in PLY",
        outcome: "points in their base colours, told; compressed ones are refused",
    },
    Kind {
        fault: "unknown words in headers of PLY and PCD, old and vendor headers",
        outcome: "skipped, told; a binary file then has to fit exactly",
    },
    Kind { fault: "a name that comes twice", outcome: "the first counts, others get `_2`, told" },
    Kind {
        fault: "noise classes 7 and 18, withheld points",
        outcome: "not drawn and not framed, told; files keep them; `--keep` takes or leaves classes, flags and returns",
    },
    Kind { fault: "units of 1e10 or 1e-12", outcome: "the picture of the same body at 1; numbers stay the file's" },
    Kind {
        fault: "first frames without finite points",
        outcome: "skipped in recordings, folders, pipes and watched files; the first frame with points is told",
    },
    Kind { fault: "8-bit colours of glTF without `normalized`", outcome: "shown, told" },
    Kind { fault: "cut PLY, PCD and LAS", outcome: "what is whole is read, told; compressed PCD is refused" },
    Kind {
        fault: "PTX lines of unequal length, matrices for column vectors",
        outcome: "grey where a colour is missing; matrices are turned over; both told",
    },
    Kind {
        fault: "16-bit depth images with swapped bytes",
        outcome: "read the other way round where neighbouring depths show it, told",
    },
    Kind {
        fault: "depth images of floats (TIFF, PFM, OpenEXR)",
        outcome: "metres, or millimetres if all are whole and large; told",
    },
    Kind {
        fault: "`camera_info.yaml`, Open3D's camera JSON",
        outcome: "intrinsics beside a depth image; with a pose, a camera for `render --camera`; distortion is told and stays",
    },
    Kind { fault: "`.gz` around any format", outcome: "read as what is inside; cut or damaged data are refused" },
    Kind {
        fault: "axes that are not stated",
        outcome: "a body stands on its flat end, flat scenes on their ground, all else has y up; `--axes` overrides",
    },
    Kind { fault: "far strays", outcome: "drawn if the view reaches them, but not framed" },
];
