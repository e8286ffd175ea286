//! Motion capture as its files hold it: a joint tree at rest, and the values of its channels in every frame.

use crate::asset::motion::MAX_ANGLE;
use crate::asset::rotation::{IDENTITY, Matrix3, matrix_from_axis_angle, product, transpose};

/// One motion channel: which axis, and whether it moves or turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Turn (degrees) or move (file units).
    pub rotates: bool,
}

/// One joint of the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct RigJoint {
    /// Name in the file.
    pub name: String,
    /// Parent, before this one in the list.
    pub parent: Option<usize>,
    /// Rest offset from the parent (file units).
    pub offset: [f64; 3],
    /// The axes that its channels turn about, as columns, at rest; none where they are the world's.
    pub axes: Option<Matrix3>,
    /// Its channels, the outermost rotation first.
    pub channels: Vec<Channel>,
}

/// A recording of one skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Joints, parents first.
    pub joints: Vec<RigJoint>,
    /// Frames per second.
    pub frame_rate: f64,
    /// Values of all channels, frame by frame.
    values: Vec<f64>,
    channel_count: usize,
}

/// Refuses an angle (degrees) that no motion has: its sine means nothing.
pub(crate) fn check_angle(joint: &str, angle: f64) -> Result<(), String> {
    let limit = MAX_ANGLE.to_degrees();
    if angle.abs() <= limit {
        return Ok(());
    }
    Err(format!(
        "joint '{joint}' turns by {angle:?} degrees, more than the {limit:.0} of any motion; is the file damaged?"
    ))
}

impl Recording {
    /// `values` are those of the channels of all `joints`, in order, frame by frame.
    pub(crate) fn new(joints: Vec<RigJoint>, frame_rate: f64, values: Vec<f64>) -> Self {
        let channel_count = joints.iter().map(|joint| joint.channels.len()).sum();
        Self { joints, frame_rate, values, channel_count }
    }

    /// Number of whole frames.
    pub fn frame_count(&self) -> usize {
        self.values.len() / self.channel_count.max(1)
    }

    /// Index of a joint by name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name)
    }

    /// Rest position of every joint: offsets summed from the root, no rotation.
    pub fn rest_positions(&self) -> Vec<[f64; 3]> {
        let mut rest: Vec<[f64; 3]> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let parent = joint.parent.map_or([0.0; 3], |p| rest[p]);
            rest.push(std::array::from_fn(|a| parent[a] + joint.offset[a]));
        }
        rest
    }

    /// World rotation of every joint in one frame: channel rotations multiplied in order, down the tree. A frame past the end
    /// is at rest.
    pub fn world_rotations(&self, frame: usize) -> Vec<Matrix3> {
        let start = frame.saturating_mul(self.channel_count);
        let values = self.values.get(start..start.saturating_add(self.channel_count)).unwrap_or_default();
        let mut values = values.iter();
        let mut world: Vec<Matrix3> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let mut rotation = joint.parent.map_or(IDENTITY, |p| world[p]);
            if let Some(axes) = &joint.axes {
                rotation = product(&rotation, axes);
            }
            for channel in &joint.channels {
                let value = values.next().copied().unwrap_or(0.0);
                if channel.rotates {
                    let mut turn = [0.0; 3];
                    turn[channel.axis] = value.to_radians();
                    rotation = product(&rotation, &matrix_from_axis_angle(turn));
                }
            }
            if let Some(axes) = &joint.axes {
                rotation = product(&rotation, &transpose(axes));
            }
            world.push(rotation);
        }
        world
    }
}
