/* Every wrong use of tiers, vertex buffers, held vertices and batches that the header names, one line each: what was done,
 * and the status that came back.
 *
 *   misuse_frames baked.sinew other.sinew compact.sinew
 *
 * `tests/c_programs.rs` runs this and compares the lines with `tests/misuse_frames.txt`.
 */
#include "misuse.h"

static SinewHandles *handles, *other_handles;
static SinewWorkspace *fast;
static SinewLayout handles_layout, fast_layout;

static void tiers(void)
{
    SinewWorkspace **out = (SinewWorkspace **)(void *)block.outs;
    SinewLayout *layout = (SinewLayout *)(void *)block.outs;
    SinewWorkspaceOptions options;
    uint8_t *memory = block.scratch;
    memset(&options, 0, sizeof options);
    options.struct_bytes = sizeof options;
    options.tier = SINEW_TIER_FAST;
    say("fast layout of a package without fast tier", sinew_workspace_layout_for(other_basis, &options, layout));
    say_details("fast workspace of a package without fast tier",
                sinew_workspace_create_for(other_basis, &options, memory, BLOCK_BYTES, out, &details));
    say_numbers("fast workspace in short memory",
                sinew_workspace_create_for(basis, &options, memory, fast_layout.size_bytes - 1, out, &details),
                fast_layout.size_bytes, fast_layout.size_bytes - 1);
    say("fast workspace in NULL memory", sinew_workspace_create_for(basis, &options, NULL, BLOCK_BYTES, out, NULL));
    options.tier = 2;
    say_details("workspace of an unknown tier",
                sinew_workspace_create_for(basis, &options, memory, BLOCK_BYTES, out, &details));
    options.tier = 0;
    options.kernels = 2;
    say_details("workspace on unknown kernels",
                sinew_workspace_create_for(basis, &options, memory, BLOCK_BYTES, out, &details));
    options.struct_bytes = 1;
    say("workspace with options of a wrong size", sinew_workspace_layout_for(basis, &options, layout));
}

static SinewVertexOptions vertex_options(void)
{
    SinewVertexOptions options;
    memset(&options, 0, sizeof options);
    options.struct_bytes = sizeof options;
    options.positions = (float *)(void *)block.positions;
    options.position_floats = floats;
    options.normals = (float *)(void *)block.normals;
    options.normal_floats = floats;
    options.bytes = block.extra;
    options.byte_count = BLOCK_BYTES;
    options.scratch = (float *)(void *)block.scratch;
    options.scratch_floats = 4 * (size_t)info.render_vertex_count;
    options.position_stride = options.normal_stride = options.tangent_stride = options.texture_stride = 48;
    options.normal_offset = 12;
    options.tangent_offset = 24;
    options.texture_offset = 40;
    return options;
}

static void vertices(void)
{
    SinewVertexOptions options = vertex_options();
    say("vertices of NULL", sinew_vertices_write(NULL, &options, NULL, NULL));
    say("vertices without options", sinew_vertices_write(basis, NULL, NULL, NULL));
    options.struct_bytes = 8;
    say("vertices with options of a wrong size", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.positions = NULL;
    say("vertices without positions", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.position_floats--;
    say_details("vertices with short positions", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    options.normals = NULL;
    say_details("vertices whose normals are missing", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    options.normal_floats = 0;
    say_details("vertices with short normals", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    options.bytes = NULL;
    say("vertices to NULL", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.byte_count = 47;
    say("vertices to a short buffer", sinew_vertices_write(basis, &options, NULL, NULL));
    options.byte_count = SIZE_MAX;
    say("vertices to a buffer of impossible length", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.scratch = NULL;
    say("tangents without scratch", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.scratch_floats--;
    say("tangents with a short scratch", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.scratch = (float *)(void *)(block.scratch + 2);
    say("tangents with a misaligned scratch", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.position_stride = 11;
    say_details("vertices with a stride too short", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    options.normal_offset = 8;
    say_details("vertices with normals in the positions", sinew_vertices_write(basis, &options, NULL, &details));
    options.normal_offset = SIZE_MAX;
    say("vertices with an offset beyond all memory", sinew_vertices_write(basis, &options, NULL, NULL));
    options = vertex_options();
    options.encoding = 3;
    say_details("vertices in an unknown encoding", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    say_details("texture of a package without", sinew_vertices_write(other_basis, &options, NULL, &details));
    options.bytes = block.package;
    say_details("vertices into the package", sinew_vertices_write(basis, &options, NULL, &details));
    options.bytes = block.positions;
    say_details("vertices over the positions", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    options.scratch = (float *)(void *)block.normals;
    say_details("scratch over the normals", sinew_vertices_write(basis, &options, NULL, &details));
    options = vertex_options();
    say("bounds into the buffer",
        sinew_vertices_write(basis, &options, (SinewBounds *)(void *)(block.extra + 64), NULL));
    say("bounds to a misaligned place",
        sinew_vertices_write(basis, &options, (SinewBounds *)(void *)(block.outs + 1), NULL));
    say("vertices", sinew_vertices_write(basis, &options, (SinewBounds *)(void *)block.outs, NULL));
    say("render faces to NULL", sinew_basis_render_faces(basis, NULL, (size_t *)(void *)block.outs));
    say("render faces of NULL",
        sinew_basis_render_faces(NULL, (const uint32_t **)(void *)block.outs, (size_t *)(void *)(block.outs + 64)));
}

static void holding(void)
{
    SinewHandles **out = (SinewHandles **)(void *)block.outs;
    uint8_t *memory = block.scratch;
    float target[3] = {0.0f, 0.0f, 0.0f};
    uint32_t k;
    say("handles layout to NULL", sinew_handles_layout(basis, 2, NULL));
    say("handles layout of NULL", sinew_handles_layout(NULL, 2, (SinewLayout *)(void *)block.outs));
    say("handles in NULL memory", sinew_handles_create(basis, 2, NULL, BLOCK_BYTES, out, NULL));
    say("handles in misaligned memory", sinew_handles_create(basis, 2, memory + 16, BLOCK_BYTES, out, NULL));
    say_numbers("handles in short memory",
                sinew_handles_create(basis, 2, memory, handles_layout.size_bytes - 1, out, &details),
                handles_layout.size_bytes, handles_layout.size_bytes - 1);
    say("handles in the package", sinew_handles_create(basis, 2, block.package, BLOCK_BYTES, out, NULL));
    say("hold with NULL", sinew_handles_add(basis, NULL, workspace, 0, NULL));
    say("hold with controls for handles",
        sinew_handles_add(basis, (SinewHandles *)(void *)controls, workspace, 0, NULL));
    say_details("hold a vertex beyond the last", sinew_handles_add(basis, handles, workspace, info.vertex_count, &details));
    say_details("hold with a fast workspace", sinew_handles_add(basis, handles, fast, 0, &details));
    say_details("hold with another basis's workspace", sinew_handles_add(basis, handles, other_workspace, 0, &details));
    say_details("hold with another basis's handles", sinew_handles_add(basis, other_handles, workspace, 0, &details));
    must(sinew_handles_add(basis, handles, workspace, 1, NULL));
    remember();
    say_details("hold a vertex twice", sinew_handles_add(basis, handles, workspace, 1, &details));
    must(sinew_handles_add(basis, handles, workspace, 3, NULL));
    remember();
    say_details("hold more vertices than there is room for", sinew_handles_add(basis, handles, workspace, 4, &details));
    say("target of a vertex that is not held", sinew_handles_target(handles, 4, target));
    say("target from NULL", sinew_handles_target(handles, 1, NULL));
    say("target from the handles", sinew_handles_target(handles, 1, (float *)(void *)(block.extra + 64)));
    target[1] = NAN;
    say("target that is no number", sinew_handles_target(handles, 1, target));
    say("let go of a vertex that is not held", sinew_handles_remove(handles, 4));
    say("let go with NULL", sinew_handles_clear(NULL));
    say("pin a control beyond the last", sinew_handles_pin(handles, info.control_count, 1));
    say("drag without basis", sinew_drag(NULL, handles, workspace, controls, NULL, NULL));
    say("drag without handles", sinew_drag(basis, NULL, workspace, controls, NULL, NULL));
    say("drag with a fast workspace", sinew_drag(basis, handles, fast, controls, NULL, NULL));
    say("drag another basis's controls", sinew_drag(basis, handles, workspace, other_controls, NULL, NULL));
    say("drag with another basis's handles", sinew_drag(basis, other_handles, workspace, controls, NULL, NULL));
    ((SinewDragReport *)(void *)block.structs)->struct_bytes = 1;
    remember();
    say("drag with a report of a wrong size",
        sinew_drag(basis, handles, workspace, controls, (SinewDragReport *)(void *)block.structs, NULL));
    must(sinew_handles_add(other_basis, other_handles, other_workspace, 0, NULL));
    for (k = 0; k < info.control_count; k++) {
        must(sinew_control_set_unclamped(other_controls, k, FLT_MAX));
    }
    remember();
    /* The handles forget what they knew of the pose; the controls stay. */
    printf("drag from weights that overflow: %s\n",
           sinew_status_name(sinew_drag(other_basis, other_handles, other_workspace, other_controls, NULL, &details)));
    printf("  %s, controls %s\n", details.text,
           memcmp(before + (block.other_controls - arena), block.other_controls, BLOCK_BYTES) == 0 ? "stay" : "moved");
    must(sinew_controls_reset(other_controls));
    must(sinew_handles_close(handles));
    remember();
    say("drag with closed handles", sinew_drag(basis, handles, workspace, controls, NULL, NULL));
}

static SinewBatch **batch_out;

static SinewStatus make_batch(const SinewInstance *instances, size_t count)
{
    return sinew_batch_create(basis, instances, count, sizeof *instances, block.scratch, BLOCK_BYTES, batch_out, &details);
}

static void batches(void)
{
    SinewInstance instances[2], good[2];
    SinewInstanceReport report;
    SinewLayout layout;
    SinewBatch *batch = NULL;
    size_t played = 7;
    batch_out = (SinewBatch **)(void *)block.outs;
    memset(instances, 0, sizeof instances);
    instances[0].workspace = workspace;
    instances[0].controls = controls;
    instances[0].positions = (float *)(void *)block.positions;
    instances[0].position_floats = floats;
    instances[0].normals = (float *)(void *)block.normals;
    instances[0].normal_floats = floats;
    instances[1] = instances[0];
    instances[1].workspace = fast;
    instances[1].controls = other_controls;
    instances[1].positions = (float *)(void *)(block.positions + 4096);
    instances[1].normals = NULL;
    memcpy(good, instances, sizeof good);
    must(sinew_batch_layout(2, &layout));
    remember();
    say("batch layout to NULL", sinew_batch_layout(2, NULL));
    say("batch of NULL", sinew_batch_create(NULL, instances, 2, sizeof *instances, block.scratch, BLOCK_BYTES, batch_out, NULL));
    say("batch of NULL instances", make_batch(NULL, 2));
    say_numbers("batch in short memory",
                sinew_batch_create(basis, instances, 2, sizeof *instances, block.scratch, layout.size_bytes - 1, batch_out,
                                   &details),
                layout.size_bytes, layout.size_bytes - 1);
    say("batch in the package",
        sinew_batch_create(basis, instances, 2, sizeof *instances, block.package, BLOCK_BYTES, batch_out, NULL));
    say("batch of more instances than all memory holds", make_batch(instances, SIZE_MAX / 2));
    say("batch of instances of a wrong size",
        sinew_batch_create(basis, instances, 2, 8, block.scratch, BLOCK_BYTES, batch_out, NULL));
    instances[1].workspace = workspace;
    say_details("instances with one workspace", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].controls = controls;
    say_details("instances with one controls", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].positions = instances[0].positions + floats - 1;
    say_details("instances with overlapping positions", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].normals = instances[0].positions;
    say_details("an instance with normals over another's positions", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].positions = (float *)(void *)block.package;
    say_details("an instance with positions in the package", make_batch(instances, 2));
    instances[1].positions = (float *)(void *)block.scratch;
    say_details("an instance with positions in the batch", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].position_floats = floats - 1;
    say_details("an instance with short positions", make_batch(instances, 2));
    instances[1] = good[1];
    instances[1].workspace = NULL;
    say_details("an instance without workspace", make_batch(instances, 2));
    instances[1] = good[1];

    must(sinew_batch_create(basis, instances, 2, sizeof *instances, block.scratch, BLOCK_BYTES, &batch, NULL));
    remember();
    say("play NULL", sinew_batch_play(basis, NULL, &played, NULL));
    say("play without basis", sinew_batch_play(NULL, batch, &played, NULL));
    say("play a surface", sinew_batch_play(basis, (SinewBatch *)(void *)controls, &played, NULL));
    say("play with the result in the batch", sinew_batch_play(basis, batch, (size_t *)(void *)(block.scratch + 64), NULL));
    printf("the count stands at %lu\n", (unsigned long)played);
    say("play", sinew_batch_play(basis, batch, &played, NULL));
    printf("the count stands at %lu\n", (unsigned long)played);
    report.struct_bytes = sizeof report;
    say("report of NULL", sinew_batch_report(NULL, 0, &report));
    say("report to NULL", sinew_batch_report(batch, 0, NULL));
    say("report of an instance beyond the last", sinew_batch_report(batch, 2, &report));
    must(sinew_batch_report(batch, 0, &report));
    printf("  %s, outcome %ld\n", sinew_status_name(report.status), (long)report.outcome);
    must(sinew_batch_report(batch, 1, &report));
    printf("  %s, outcome %ld\n", sinew_status_name(report.status), (long)report.outcome);
    say("play a round that is over", sinew_batch_play(basis, batch, &played, NULL));
    printf("the count stands at %lu\n", (unsigned long)played);
    must(sinew_batch_begin(batch));
    say("play the next round", sinew_batch_play(basis, batch, &played, NULL));
    printf("the count stands at %lu\n", (unsigned long)played);
    say("begin NULL", sinew_batch_begin(NULL));
    must(sinew_batch_close(batch));
    remember();
    say("play a closed batch", sinew_batch_play(basis, batch, &played, NULL));
}

int main(int argc, char **argv)
{
    SinewWorkspaceOptions options;
    prepare(argc, argv);
    memset(&options, 0, sizeof options);
    options.struct_bytes = sizeof options;
    options.tier = SINEW_TIER_FAST;
    must(sinew_workspace_layout_for(basis, &options, &fast_layout));
    must(sinew_workspace_create_for(basis, &options, block.outs + BLOCK_BYTES / 2, BLOCK_BYTES / 2, &fast, NULL));
    must(sinew_handles_layout(basis, 2, &handles_layout));
    must(sinew_handles_create(basis, 2, block.extra, BLOCK_BYTES, &handles, NULL));
    must(sinew_handles_create(other_basis, 2, block.structs + BLOCK_BYTES / 2, BLOCK_BYTES / 2, &other_handles, NULL));
    remember();
    tiers();
    holding();
    vertices();
    batches();
    return finish();
}
