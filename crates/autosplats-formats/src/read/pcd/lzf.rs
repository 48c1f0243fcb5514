//! LZF decompression for binary_compressed PCD files.

/// Output bytes between two checks for cancellation.
const BLOCK: usize = 1 << 22;

/// Largest number of bytes that one compressed byte can expand to: three bytes encode a copy of at most 264.
pub(super) const MAX_RATIO: usize = 88;

/// Decompresses `input` and appends to `output`, at most `limit` bytes. The inner error is the place and kind of a
/// fault. `go_on` is called now and then with the number of bytes made so far; its error ends the work.
pub(super) fn decompress<E>(
    input: &[u8],
    limit: usize,
    output: &mut Vec<u8>,
    mut go_on: impl FnMut(usize) -> Result<(), E>,
) -> Result<Result<(), (usize, &'static str)>, E> {
    let mut at = 0;
    let mut next_look = BLOCK;
    while at < input.len() {
        if output.len() >= next_look {
            go_on(output.len())?;
            next_look = output.len() + BLOCK;
        }
        let control = usize::from(input[at]);
        let place = at;
        let fault = |what| Ok(Err((place, what)));
        if control < 32 {
            let Some(literal) = input.get(at + 1..at + 2 + control) else {
                return fault("the compressed data end inside a run");
            };
            output.extend_from_slice(literal);
            at += 2 + control;
        } else {
            let long = control >> 5 == 7;
            let Some(operands) = input.get(at + 1..at + 2 + usize::from(long)) else {
                return fault("the compressed data end inside a reference");
            };
            let len = (control >> 5) + 2 + if long { usize::from(operands[0]) } else { 0 };
            let back = ((control & 31) << 8 | usize::from(operands[operands.len() - 1])) + 1;
            let Some(from) = output.len().checked_sub(back) else {
                return fault("the compressed data refer to before their start");
            };
            if back >= len {
                output.extend_from_within(from..from + len);
            } else {
                // The copy overlaps its own output: a repetition.
                for index in from..from + len {
                    output.push(output[index]);
                }
            }
            at += 1 + operands.len();
        }
        if output.len() > limit {
            return fault("the compressed data hold more than the header says");
        }
    }
    Ok(Ok(()))
}

#[cfg(test)]
mod tests {
    use super::decompress;

    fn run(input: &[u8], limit: usize) -> Result<Vec<u8>, (usize, &'static str)> {
        let mut output = Vec::new();
        let Ok(result) = decompress(input, limit, &mut output, |_| Ok::<(), std::convert::Infallible>(()));
        result.map(|()| output)
    }

    #[test]
    fn literals_copies_and_repetitions() {
        assert_eq!(run(&[2, b'a', b'b', b'c'], 9), Ok(b"abc".to_vec()), "a run of three");
        assert_eq!(run(&[2, b'a', b'b', b'c', 0x20, 2], 9), Ok(b"abcabc".to_vec()), "three bytes from three back");
        assert_eq!(run(&[0, b'a', 0x60, 0], 9), Ok(b"aaaaaa".to_vec()), "five bytes from one back");
        assert_eq!(run(&[0, b'a', 0xe0, 1, 0], 99), Ok(vec![b'a'; 11]), "a long copy: 7 + 1 + 2 bytes");
    }

    #[test]
    fn faults_are_told() {
        assert!(run(&[2, b'a'], 9).is_err(), "cut inside a run");
        assert!(run(&[0, b'a', 0x20], 9).is_err(), "cut inside a reference");
        assert!(run(&[0, b'a', 0x20, 1], 9).is_err(), "two back after one byte");
        assert!(run(&[2, b'a', b'b', b'c'], 2).is_err(), "more than the limit");
    }
}
