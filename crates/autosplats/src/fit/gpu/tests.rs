//! The fit on the GPU against that on the CPU.
