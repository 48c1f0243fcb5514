//! What a frame asks of a device, counted from its steps alone.

use std::collections::HashMap;

use super::recorder::DISPATCH_BYTES;
use super::step::{Groups, Step, Use};

/// What the passes of a stage ask of a device in one frame. It is the same for every camera and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct StageWork {
    /// The stage, `project`.
    pub stage: &'static str,
    /// Number of dispatches. Passes that draw count as one each.
    pub dispatches: usize,
    /// How many dispatches longer the stage makes the frame's longest chain of dispatches that wait for each other.
    /// There is a barrier between any two of the chain. The sum over all stages is the length of the chain.
    pub chain: usize,
    /// Bytes of all buffers that the dispatches bind, twice where a pass may write. This bounds what passes could touch
    /// once: buffers are as large as the screen or the cloud may ever need. Textures and draws are not counted.
    pub bytes: u64,
}

/// The work of each stage, in the order of first steps.
#[allow(clippy::mutable_key_type, reason = "buffers are compared by what they are, not by what they hold")]
pub(crate) fn stage_work(steps: &[Step]) -> Vec<StageWork> {
    let mut stages: Vec<StageWork> = Vec::new();
    // For each buffer, the lengths of the chains that end with its last write, and with the longest read since.
    let mut ends: HashMap<wgpu::Buffer, [usize; 2]> = HashMap::new();
    let mut longest = 0;
    for step in steps {
        let counted = step.groups().and_then(|groups| match groups {
            Groups::Counted(arguments, _) => {
                Some(Use { buffer: arguments.clone(), bytes: DISPATCH_BYTES, writes: false })
            }
            Groups::Number(_) => None,
        });
        let uses: Vec<&Use> = step.uses.iter().chain(&counted).collect();
        // Two dispatches wait for each other if they share a buffer that one of them writes.
        let before = |bound: &&Use| {
            let [written, read] = ends.get(&bound.buffer).copied().unwrap_or_default();
            if bound.writes { written.max(read) } else { written }
        };
        let length = 1 + uses.iter().map(before).max().unwrap_or(0);
        for bound in &uses {
            let end = ends.entry(bound.buffer.clone()).or_default();
            let place = usize::from(!bound.writes);
            end[place] = end[place].max(length);
        }
        let at = stages.iter().position(|work| work.stage == step.stage()).unwrap_or_else(|| {
            stages.push(StageWork { stage: step.stage(), dispatches: 0, chain: 0, bytes: 0 });
            stages.len() - 1
        });
        let work = &mut stages[at];
        work.dispatches += 1;
        work.chain += length.saturating_sub(longest);
        work.bytes += uses.iter().map(|bound| bound.bytes * (1 + u64::from(bound.writes))).sum::<u64>();
        longest = longest.max(length);
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::super::{Library, Pass, PassSource, test_gpu};
    use super::*;

    #[test]
    fn stages_have_their_dispatches_chain_and_bytes() {
        const LIBRARY: Library = Library { files: &[], constants: &[] };
        const CODE: &str = "@group(0) @binding(0) var<storage> source: array<u32>;\n\
                            @group(0) @binding(1) var<storage, read_write> target_of: array<u32>;\n\
                            @compute @workgroup_size(1) fn copy() { target_of[0] = source[0]; }";
        let Some(gpu) = test_gpu() else { return };
        let [a, b, c] = [8, 16, 32].map(|len| gpu.storage::<u32>("x", len).expect("room"));
        let step = |path, from, to, groups: Groups| {
            let source = PassSource { path, source: CODE, needs: wgpu::Features::empty(), library: &LIBRARY };
            Pass::new(&gpu, &source, &[]).expect("a pass").step(&gpu, &[from, to], groups)
        };
        let number = Groups::Number(1);
        let steps = [
            step("project/copy", &a, &b, number.clone()),
            step("project/copy", &a, &c, number.clone()),
            step("fit/copy", &a, &c, Groups::Counted(b.clone(), 0)),
            step("project/copy", &c, &b, number),
        ];
        let work = |stage, dispatches, chain, bytes| StageWork { stage, dispatches, chain, bytes };
        let project = work("project", 3, 2, (32 + 2 * 64) + (32 + 2 * 128) + (128 + 2 * 64));
        assert_eq!(stage_work(&steps), [project, work("fit", 1, 1, 32 + 2 * 128 + DISPATCH_BYTES)]);
    }
}
