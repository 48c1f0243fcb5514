//! Looks
