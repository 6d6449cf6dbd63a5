//! Transforms of an Alembic archive: a list of operations, the outermost first, and the numbers they take.

use super::headers::{Archive, Property};
use crate::error::SequenceError;
use glam::{DAffine3, DMat4, DQuat, DVec3};

/// Operations and where their numbers are.
pub(super) struct Transform {
    operations: Vec<Operation>,
    /// Numbers of all operations, sample by sample; none for the identity.
    pub(super) values: Option<Property>,
    /// Whether the transforms above apply too.
    pub(super) inherits: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Operation {
    Scale,
    Translate,
    /// About an axis, in degrees.
    Rotate,
    Matrix,
    RotateX,
    RotateY,
    RotateZ,
}

impl Operation {
    /// The upper half of its code; the lower is a hint to its use.
    fn of_code(code: i64) -> Option<Operation> {
        Some(match code >> 4 {
            0 => Operation::Scale,
            1 => Operation::Translate,
            2 => Operation::Rotate,
            3 => Operation::Matrix,
            4 => Operation::RotateX,
            5 => Operation::RotateY,
            6 => Operation::RotateZ,
            _ => return None,
        })
    }

    fn number_count(self) -> usize {
        match self {
            Operation::Scale | Operation::Translate => 3,
            Operation::Rotate => 4,
            Operation::Matrix => 16,
            Operation::RotateX | Operation::RotateY | Operation::RotateZ => 1,
        }
    }

    fn matrix(self, n: &[f64]) -> DAffine3 {
        match self {
            Operation::Scale => DAffine3::from_scale(DVec3::new(n[0], n[1], n[2])),
            Operation::Translate => DAffine3::from_translation(DVec3::new(n[0], n[1], n[2])),
            Operation::Rotate => match DVec3::new(n[0], n[1], n[2]).try_normalize() {
                Some(axis) => DAffine3::from_quat(DQuat::from_axis_angle(axis, n[3].to_radians())),
                None => DAffine3::IDENTITY,
            },
            Operation::Matrix => {
                let mut columns = [0.0; 16];
                columns.copy_from_slice(n);
                // Alembic multiplies rows from the left: its rows are our columns.
                DAffine3::from_mat4(DMat4::from_cols_array(&columns))
            }
            Operation::RotateX => DAffine3::from_rotation_x(n[0].to_radians()),
            Operation::RotateY => DAffine3::from_rotation_y(n[0].to_radians()),
            Operation::RotateZ => DAffine3::from_rotation_z(n[0].to_radians()),
        }
    }
}

impl Transform {
    /// Reads the operations from the properties of an object.
    pub(super) fn read(archive: &mut Archive, properties: &[Property]) -> Result<Transform, SequenceError> {
        let mut transform = Transform {
            operations: Vec::new(),
            values: None,
            inherits: true,
        };
        let Some(compound) = properties.iter().find(|property| property.name == ".xform") else {
            return Ok(transform);
        };
        for property in archive.inside(compound)? {
            match property.name.as_str() {
                ".inherits" => {
                    let (_, raw) = archive.raw(&property, 0)?;
                    transform.inherits = raw.first().is_none_or(|&byte| byte != 0);
                }
                ".ops" => {
                    let (pod, raw) = archive.raw(&property, 0)?;
                    let codes = pod.integers(&raw).unwrap_or_default();
                    let operations: Option<Vec<Operation>> = codes.into_iter().map(Operation::of_code).collect();
                    transform.operations = operations.ok_or_else(|| {
                        archive
                            .file
                            .refuse(0, "operations of a transform that are known", "another code")
                    })?;
                }
                ".vals" => transform.values = Some(property),
                _ => {}
            }
        }
        Ok(transform)
    }

    /// The transform, or none where the operations take another count of numbers.
    pub(super) fn matrix(&self, numbers: &[f64]) -> Option<DAffine3> {
        let needed: usize = self.operations.iter().map(|operation| operation.number_count()).sum();
        if needed != numbers.len() {
            return None;
        }
        let mut rest = numbers;
        let mut whole = DAffine3::IDENTITY;
        for operation in &self.operations {
            let (own, behind) = rest.split_at(operation.number_count());
            whole *= operation.matrix(own);
            rest = behind;
        }
        Some(whole)
    }
}

/// The numbers of sample `n`.
pub(super) fn numbers(archive: &mut Archive, values: &Property, n: usize) -> Result<Vec<f64>, SequenceError> {
    let (pod, raw) = archive.raw(values, n)?;
    pod.floats(&raw).ok_or_else(|| {
        archive
            .file
            .refuse(0, "numbers of a transform as floats", "another type")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_apply_from_the_last_to_the_first() {
        let codes = [0x10, 0x62, 0x20, 0x00, 0x30];
        let transform = Transform {
            operations: codes
                .into_iter()
                .map(|code| Operation::of_code(code).unwrap())
                .collect(),
            values: None,
            inherits: true,
        };
        let mut numbers = vec![5.0, 0.0, 0.0, 90.0, 0.0, 0.0, 2.0, 90.0, 2.0, 3.0, 4.0];
        // Moves along z by one.
        numbers.extend([1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 1., 1.]);
        let found = transform
            .matrix(&numbers)
            .unwrap()
            .transform_point3(DVec3::new(1.0, 1.0, 1.0));
        // Moved: (1, 1, 2); scaled: (2, 3, 8); turned by half a turn in all: (-2, -3, 8); moved.
        assert!((found - DVec3::new(3.0, -3.0, 8.0)).length() < 1e-12, "{found}");
        assert!(transform.matrix(&numbers[1..]).is_none());
        assert!(Operation::of_code(0x70).is_none());
    }
}
