//! Definitions of common messages, for bags of ROS 2 before Iron, which hold none.
//!
//! Names and order of the fields are those of the packages `std_msgs`, `geometry_msgs`, `sensor_msgs`, `nav_msgs`, `tf2_msgs`,
//! `trajectory_msgs` and `control_msgs` of ROS 2 Humble.

const DEFINITIONS: [(&str, &str); 38] = [
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
    ("std_msgs/Bool", "bool data"),
    ("std_msgs/String", "string data"),
    ("std_msgs/Int8", "int8 data"),
    ("std_msgs/Int16", "int16 data"),
    ("std_msgs/Int32", "int32 data"),
    ("std_msgs/Int64", "int64 data"),
    ("std_msgs/UInt8", "uint8 data"),
    ("std_msgs/UInt32", "uint32 data"),
    ("std_msgs/Float32", "float32 data"),
    ("std_msgs/Float64", "float64 data"),
    ("std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride"),
    ("std_msgs/MultiArrayLayout", "MultiArrayDimension[] dim\nuint32 data_offset"),
    ("std_msgs/Float32MultiArray", "MultiArrayLayout layout\nfloat32[] data"),
    ("std_msgs/Float64MultiArray", "MultiArrayLayout layout\nfloat64[] data"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"),
    ("geometry_msgs/Pose", "Point position\nQuaternion orientation"),
    ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation"),
    ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular"),
    ("geometry_msgs/Wrench", "Vector3 force\nVector3 torque"),
    ("geometry_msgs/PointStamped", "std_msgs/Header header\nPoint point"),
    ("geometry_msgs/Vector3Stamped", "std_msgs/Header header\nVector3 vector"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose"),
    ("geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance"),
    ("geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header header\nPoseWithCovariance pose"),
    ("geometry_msgs/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\nTwist twist"),
    ("geometry_msgs/TwistWithCovariance", "Twist twist\nfloat64[36] covariance"),
    ("geometry_msgs/WrenchStamped", "std_msgs/Header header\nWrench wrench"),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    ),
    (
        "trajectory_msgs/JointTrajectoryPoint",
        "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n\
         builtin_interfaces/Duration time_from_start",
    ),
    // What follows differs from version to version, and is not read.
    (
        "control_msgs/JointTrajectoryControllerState",
        "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n\
         trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error",
    ),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec"),
];

/// The definition of a message such as `geometry_msgs/msg/PoseStamped`, with all that it may be made of.
pub(crate) fn definition(name: &str) -> Option<String> {
    let short = name.replace("/msg/", "/");
    let (_, own) = DEFINITIONS.iter().find(|(other, _)| *other == short)?;
    let mut text = (*own).to_string();
    for (name, definition) in DEFINITIONS {
        text.push_str(&format!("\n========\nMSG: {name}\n{definition}"));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema::Schema;

    #[test]
    fn every_definition_is_complete() {
        for (name, _) in DEFINITIONS {
            let schema = Schema::parse(name, &definition(name).unwrap()).unwrap();
            assert!(!schema.types[0].is_empty(), "{name}");
        }
        assert_eq!(definition("my_msgs/msg/Own"), None);
    }
}
