//! Points taken out of a cloud.

use rayon::prelude::*;

use crate::{PointCloud, cloud::each_type};

impl PointCloud {
    /// Keeps the points that `keep` says yes to, by their index, with all attributes and in the same order.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool + Sync + Send) {
        let keep: Vec<bool> = (0..self.len()).into_par_iter().map(keep).collect();
        if keep.iter().all(|&keep| keep) {
            return;
        }
        for scan in &mut self.scans {
            let kept = |range: std::ops::Range<usize>| keep[range].iter().filter(|&&keep| keep).count();
            let start = kept(0..scan.points.start);
            scan.points = start..start + kept(scan.points.clone());
        }
        compact(&mut self.positions, &keep);
        if let Some(residuals) = &mut self.residuals {
            compact(residuals, &keep);
        }
        if let Some(colors) = &mut self.colors {
            compact(colors, &keep);
        }
        for field in &mut self.fields {
            each_type!(&mut field.values, v => compact(v, &keep));
        }
    }
}

fn compact<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut index = 0;
    values.retain(|_| {
        index += 1;
        keep[index - 1]
    });
}
