//! Recordings at rest: MCAP, rosbag2 and CSV to joint states or Arrow columns, and back.
