//! The robot as mathematics: URDF, kinematics, RNEA, regressor, and the physics a rigid twin lacks.
