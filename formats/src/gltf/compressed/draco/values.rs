//! Values of a decoded stream as bytes of an accessor.

use draco_core::{DataType, Mesh, PointAttribute, PointIndex};

use crate::document::{Component, Element};

/// Returns the values of an attribute, one per point, as elements of an accessor.
///
/// # Errors
/// Describes why the stream does not have such values.
pub(super) fn of_attribute(mesh: &Mesh, id: u32, element: Element) -> Result<Vec<u8>, String> {
    let attribute =
        mesh.attribute_by_unique_id(id).ok_or_else(|| format!("the stream has no attribute with the id {id}"))?;
    let components = usize::from(attribute.num_components());
    if components != element.components {
        return Err(format!("the accessor has {} components, but the stream has {components}", element.components));
    }
    let stored = attribute.data_type();
    let size = components * stored.byte_length();
    let mut bytes = Vec::with_capacity(mesh.num_points() * element.size());
    for point in 0..mesh.num_points() {
        let value = value(attribute, point, size).ok_or("the stream has points without a value of the attribute")?;
        if is_stored_as(stored, element.component) {
            bytes.extend_from_slice(value);
        } else {
            for raw in value.chunks_exact(stored.byte_length().max(1)) {
                let number = number(stored, raw, attribute.normalized());
                push(&mut bytes, element.component, number?)
                    .ok_or("a value of the stream does not fit the accessor")?;
            }
        }
    }
    Ok(bytes)
}

/// Returns the bytes of the value of a point.
fn value(attribute: &PointAttribute, point: usize, size: usize) -> Option<&[u8]> {
    let index = attribute.mapped_index(PointIndex(u32::try_from(point).ok()?)).0 as usize;
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let start = index.checked_mul(stride)?;
    attribute.buffer().data().get(start..start.checked_add(size)?)
}

/// Whether the values of a stream are those of an accessor, byte by byte.
fn is_stored_as(stored: DataType, component: Component) -> bool {
    matches!(
        (stored, component),
        (DataType::Int8, Component::I8)
            | (DataType::Uint8 | DataType::Bool, Component::U8)
            | (DataType::Int16, Component::I16)
            | (DataType::Uint16, Component::U16)
            | (DataType::Uint32, Component::U32)
            | (DataType::Float32, Component::F32)
    )
}

/// A number of a stream.
enum Number {
    /// An integer, and what stands for 1 if floats of it are fractions.
    Integer(i64, f64),
    Float(f64),
}

fn number(stored: DataType, raw: &[u8], normalized: bool) -> Result<Number, String> {
    let mut eight = [0; 8];
    eight[..raw.len()].copy_from_slice(raw);
    let bits = u64::from_le_bytes(eight);
    let (integer, largest) = match stored {
        DataType::Int8 => (i64::from(bits as i8), 127.0),
        DataType::Uint8 | DataType::Bool => (i64::from(bits as u8), 255.0),
        DataType::Int16 => (i64::from(bits as i16), 32_767.0),
        DataType::Uint16 => (i64::from(bits as u16), 65_535.0),
        DataType::Int32 => (i64::from(bits as i32), 2_147_483_647.0),
        DataType::Uint32 => (i64::from(bits as u32), 4_294_967_295.0),
        DataType::Float32 => return Ok(Number::Float(f64::from(f32::from_bits(bits as u32)))),
        DataType::Float64 => return Ok(Number::Float(f64::from_bits(bits))),
        DataType::Int64 | DataType::Uint64 | DataType::Invalid => {
            return Err(format!("the stream has values of the type {stored:?}, which glTF does not have"));
        }
    };
    Ok(Number::Integer(integer, if normalized { largest } else { 1.0 }))
}

/// Appends a number; `None` if the component type cannot hold it.
fn push(bytes: &mut Vec<u8>, component: Component, number: Number) -> Option<()> {
    let integer = match (component, number) {
        (Component::F32, Number::Integer(integer, one)) => {
            bytes.extend(((integer as f64 / one) as f32).to_le_bytes());
            return Some(());
        }
        (Component::F32, Number::Float(x)) => {
            bytes.extend((x as f32).to_le_bytes());
            return Some(());
        }
        (_, Number::Integer(integer, _)) => integer,
        (_, Number::Float(_)) => return None,
    };
    match component {
        Component::I8 => bytes.extend(i8::try_from(integer).ok()?.to_le_bytes()),
        Component::U8 => bytes.extend(u8::try_from(integer).ok()?.to_le_bytes()),
        Component::I16 => bytes.extend(i16::try_from(integer).ok()?.to_le_bytes()),
        Component::U16 => bytes.extend(u16::try_from(integer).ok()?.to_le_bytes()),
        Component::U32 | Component::F32 => bytes.extend(u32::try_from(integer).ok()?.to_le_bytes()),
    }
    Some(())
}

/// Returns the corners of all triangles, in a component type that holds them: the given one, or a larger one.
///
/// # Errors
/// Fails if a corner is not a point.
pub(super) fn of_indices(mesh: &Mesh, least: Component) -> Result<(Vec<u8>, Component), String> {
    let corners = || mesh.faces().iter().flatten().map(|point| point.0);
    let largest = corners().max().unwrap_or(0);
    if largest as usize >= mesh.num_points() {
        return Err(format!("the stream has a triangle of point {largest}, but only {} points", mesh.num_points()));
    }
    // The largest number of a type means "restart" to a GPU.
    let fits = |most: u32| largest < most;
    Ok(match least {
        Component::U8 if fits(u8::MAX.into()) => (corners().map(|i| i as u8).collect(), Component::U8),
        Component::U8 | Component::U16 if fits(u16::MAX.into()) => {
            (corners().flat_map(|i| (i as u16).to_le_bytes()).collect(), Component::U16)
        }
        _ => (corners().flat_map(u32::to_le_bytes).collect(), Component::U32),
    })
}
