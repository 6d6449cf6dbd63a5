//! Rules of the compact payload.

use super::{
    super::{CompactView, GraphConvRecord, OpenError, limits},
    BlockLinks, after, below, control, count, names, positions, positive, prior, same_count, surface, title, tree,
    value_scales, within,
};

/// Proves every promise that [`super::super::CompactBasis`] makes.
pub(in super::super) fn check(view: &CompactView<'_>) -> Result<(), OpenError> {
    let vertex_count = positions(view.rest_positions(), 3)?;
    surface(&view.surface(), vertex_count)?;
    bridges(view.bridges(), vertex_count)?;
    below("anchor_vertex", 0, view.anchor_vertex(), vertex_count)?;
    positive("rotation_scale", 0, view.rotation_scale(), limits::FEATURE_SCALE)?;
    positive("stretch_scale", 0, view.stretch_scale(), limits::FEATURE_SCALE)?;
    let links = |b| {
        let block = view.block(b);
        BlockLinks {
            level: block.level,
            parent_component: block.parent_component,
            first_component: block.first_component,
            component_count: block.component_count,
        }
    };
    tree(view.block_count(), links, view.component_count(), |k| {
        view.component(k).block
    })?;
    for (b, block) in view.blocks().enumerate() {
        network("blocks.encoder", b, &block.encoder)?;
        network("blocks.decoder", b, &block.decoder)?;
    }
    names(view.component_count(), |k| view.component(k).name)?;
    for (k, component) in view.components().enumerate() {
        below("components.centre_vertex", k, component.centre_vertex, vertex_count)?;
        within("components.scale", k, component.scale, 0.0, 1.0)?;
        within("components.strength", k, component.strength, 0.0, limits::QUALITY)?;
        within("components.locality", k, component.locality, 0.0, 1.0)?;
        control(k, component.minimum, component.maximum)?;
        value_scales(k, component.value_scales)?;
    }
    supports(view, vertex_count)?;
    provenance(view)?;
    quality(view)?;
    after(&view.after(), view.component_count(), vertex_count)?;
    prior(&view.prior(), view.component_count())?;
    count("encoder", view.encoder().len(), 0, limits::ENCODER_BYTES)
}

fn bridges(bridges: &[[u32; 2]], vertex_count: usize) -> Result<(), OpenError> {
    count("bridges", bridges.len(), 0, limits::BRIDGES)?;
    for (index, &[from, to]) in bridges.iter().enumerate() {
        below("bridges", index, to, vertex_count)?;
        if from >= to || index > 0 && bridges[index - 1] >= [from, to] {
            return Err(OpenError::NotAscending {
                field: "bridges",
                index,
            });
        }
    }
    Ok(())
}

fn network(field: &'static str, block: usize, conv: &GraphConvRecord) -> Result<(), OpenError> {
    let rows = conv.point.iter().chain(&conv.neighbour).chain([&conv.bias]);
    for &value in rows.flatten() {
        within(field, block, value, -limits::NETWORK_VALUE, limits::NETWORK_VALUE)?;
    }
    Ok(())
}

fn supports(view: &CompactView<'_>, vertex_count: usize) -> Result<(), OpenError> {
    let (bits, values) = (view.support_bits(), view.values());
    let words = vertex_count.div_ceil(32);
    // Neither factor exceeds its limit any more, so the product fits even 32 bits.
    same_count("support_bits", bits.len(), view.component_count() * words)?;
    let used_bits = vertex_count - 32 * (words - 1);
    let unused = u32::MAX.checked_shl(used_bits as u32).unwrap_or(0);
    if let Some(component) = bits.chunks_exact(words).position(|row| row[words - 1] & unused != 0) {
        return Err(OpenError::BitmapTail { component });
    }
    count("values", values.len(), 0, limits::ENTRIES)?;
    // At most 2^34 bits: counted in 64, so that a 32-bit device refuses what it cannot hold.
    let entry_count: u64 = bits.iter().map(|word| u64::from(word.count_ones())).sum();
    if values.len() as u64 != entry_count {
        return Err(OpenError::CountMismatch {
            field: "values",
            expected: entry_count,
            actual: values.len() as u64,
        });
    }
    Ok(())
}

fn provenance(view: &CompactView<'_>) -> Result<(), OpenError> {
    let provenance = view.provenance();
    title("provenance.tool", 0, provenance.tool, limits::TITLE_BYTES)?;
    title("provenance.sequence", 0, provenance.sequence, limits::TITLE_BYTES)?;
    count("provenance.config", provenance.config.len(), 0, limits::CONFIG_BYTES)?;
    let shape_count = provenance.shape_count as usize;
    count("provenance.shape_count", shape_count, 1, limits::SHAPES)?;
    let shapes = provenance.train_shapes.iter().copied();
    super::ascending_below("provenance.train_shapes", 0, shapes, shape_count)
}

fn quality(view: &CompactView<'_>) -> Result<(), OpenError> {
    const NOT_MEASURED: f32 = -1.0;
    let quality = view.quality();
    if quality.validation_e_rms != NOT_MEASURED {
        within(
            "quality.validation_e_rms",
            0,
            quality.validation_e_rms,
            0.0,
            limits::QUALITY,
        )?;
    }
    let limit = quality.steps_run as usize;
    count("quality.steps", quality.steps as usize, 0, limit)
}
