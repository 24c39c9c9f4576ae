//! Recordings of drives: MCAP files that robotics tools open.
