pub(crate) mod gpu;
