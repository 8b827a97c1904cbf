//! Where samples come from: archives, live ROS 2 over Zenoh, the simulated cell.
