/* Every wrong use of tiers, bones, vertex buffers, pins and batches that the header names, one line each: what was done,
 * and the status that came back.
 *
 *   misuse_frames baked.sinew other.sinew compact.sinew
 *
 * `tests/c_programs.rs` runs this and compares the lines with `tests/misuse_frames.txt`.
 */
#include "misuse.h"

static SinewPins *pins, *other_pins;
static SinewWorkspace *bones;
static SinewLayout pins_layout, bones_layout;

static void tiers(void)
{
    SinewWorkspace **out = (SinewWorkspace **)(void *)block.outs;
    SinewLayout *layout = (SinewLayout *)(void *)block.outs;
    SinewWorkspaceOptions options = SINEW_INIT(SinewWorkspaceOptions);
    uint8_t *memory = block.scratch;
    options.tier = SINEW_TIER_BONES;
    say("bones layout of a package without bones", sinew_workspace_layout(other_basis, &options, layout));
    say_details("bones workspace of a package without bones",
                sinew_workspace_create(other_basis, &options, memory, BLOCK_BYTES, out, &details));
    say_numbers("bones workspace in short memory",
                sinew_workspace_create(basis, &options, memory, bones_layout.size_bytes - 1, out, &details),
                bones_layout.size_bytes, bones_layout.size_bytes - 1);
    say("bones workspace in NULL memory", sinew_workspace_create(basis, &options, NULL, BLOCK_BYTES, out, NULL));
    options.tier = 2;
    say_details("workspace of an unknown tier",
                sinew_workspace_create(basis, &options, memory, BLOCK_BYTES, out, &details));
    options.tier = 0;
    options.kernels = 2;
    say_details("workspace on unknown kernels",
                sinew_workspace_create(basis, &options, memory, BLOCK_BYTES, out, &details));
    options.struct_bytes = 1;
    say("workspace with options of a wrong size", sinew_workspace_layout(basis, &options, layout));
}

static SinewVertexOptions vertex_options(void)
{
    SinewVertexOptions options = SINEW_INIT(SinewVertexOptions);
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
    options.encoding = 4;
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
    say("render faces to NULL", sinew_basis_render_faces(basis, 0, NULL, 3 * (size_t)info.face_count));
    say("render faces of NULL", sinew_basis_render_faces(NULL, 0, (uint32_t *)(void *)block.outs, BLOCK_BYTES / 4));
    say("render faces in an unknown winding",
        sinew_basis_render_faces(basis, 2, (uint32_t *)(void *)block.outs, BLOCK_BYTES / 4));
}

static void pinning(void)
{
    SinewPins **out = (SinewPins **)(void *)block.outs;
    uint8_t *memory = block.scratch;
    float target[3] = {0.0f, 0.0f, 0.0f};
    uint32_t k;
    say("pins layout to NULL", sinew_pins_layout(basis, 2, NULL));
    say("pins layout of NULL", sinew_pins_layout(NULL, 2, (SinewLayout *)(void *)block.outs));
    say("pins in NULL memory", sinew_pins_create(basis, 2, NULL, BLOCK_BYTES, out, NULL));
    say("pins in misaligned memory", sinew_pins_create(basis, 2, memory + 16, BLOCK_BYTES, out, NULL));
    say_numbers("pins in short memory",
                sinew_pins_create(basis, 2, memory, pins_layout.size_bytes - 1, out, &details),
                pins_layout.size_bytes, pins_layout.size_bytes - 1);
    say("pins in the package", sinew_pins_create(basis, 2, block.package, BLOCK_BYTES, out, NULL));
    say("pin with NULL", sinew_pins_add(basis, NULL, workspace, 0, NULL));
    say("pin with controls for pins",
        sinew_pins_add(basis, (SinewPins *)(void *)controls, workspace, 0, NULL));
    say_details("pin a vertex beyond the last", sinew_pins_add(basis, pins, workspace, info.vertex_count, &details));
    say_details("pin with a workspace of bones", sinew_pins_add(basis, pins, bones, 0, &details));
    say_details("pin with another basis's workspace", sinew_pins_add(basis, pins, other_workspace, 0, &details));
    say_details("pin with another basis's pins", sinew_pins_add(basis, other_pins, workspace, 0, &details));
    must(sinew_pins_add(basis, pins, workspace, 1, NULL));
    remember();
    say_details("pin a vertex twice", sinew_pins_add(basis, pins, workspace, 1, &details));
    must(sinew_pins_add(basis, pins, workspace, 3, NULL));
    remember();
    say_details("pin more vertices than there is room for", sinew_pins_add(basis, pins, workspace, 4, &details));
    say("target of a vertex that is not pinned", sinew_pins_move(pins, 4, target));
    say("target from NULL", sinew_pins_move(pins, 1, NULL));
    say("target from the pins", sinew_pins_move(pins, 1, (float *)(void *)(block.extra + 64)));
    target[1] = NAN;
    say("target that is no number", sinew_pins_move(pins, 1, target));
    say("let go of a vertex that is not pinned", sinew_pins_remove(pins, 4));
    say("let go with NULL", sinew_pins_clear(NULL));
    say("lock a control beyond the last", sinew_pins_lock(pins, info.control_count, 1));
    say("drag without basis", sinew_pins_drag(NULL, pins, workspace, controls, NULL, NULL));
    say("drag without pins", sinew_pins_drag(basis, NULL, workspace, controls, NULL, NULL));
    say("drag with a workspace of bones", sinew_pins_drag(basis, pins, bones, controls, NULL, NULL));
    say("drag another basis's controls", sinew_pins_drag(basis, pins, workspace, other_controls, NULL, NULL));
    say("drag with another basis's pins", sinew_pins_drag(basis, other_pins, workspace, controls, NULL, NULL));
    ((SinewDragReport *)(void *)block.structs)->struct_bytes = 1;
    remember();
    say("drag with a report of a wrong size",
        sinew_pins_drag(basis, pins, workspace, controls, (SinewDragReport *)(void *)block.structs, NULL));
    must(sinew_pins_add(other_basis, other_pins, other_workspace, 0, NULL));
    for (k = 0; k < info.control_count; k++) {
        must(sinew_control_set_unclamped(other_controls, k, FLT_MAX));
    }
    remember();
    /* The pins forget what they knew of the pose; the controls stay. */
    printf("drag from weights that overflow: %s\n",
           sinew_status_name(sinew_pins_drag(other_basis, other_pins, other_workspace, other_controls, NULL, &details)));
    printf("  %s, controls %s\n", details.text,
           memcmp(before + (block.other_controls - arena), block.other_controls, BLOCK_BYTES) == 0 ? "stay" : "moved");
    must(sinew_controls_reset(other_controls));
    must(sinew_close(pins));
    remember();
    say("drag with closed pins", sinew_pins_drag(basis, pins, workspace, controls, NULL, NULL));
}

static void posing(void)
{
    float *maps = (float *)(void *)block.scratch;
    uint16_t *weights = (uint16_t *)(void *)block.outs;
    size_t room = 12 * (size_t)info.bone_count, count = (size_t)info.bone_influences * info.vertex_count;
    say("bones of NULL", sinew_bones_pose(NULL, bones, controls, 0, maps, room, NULL));
    say_details("bones of a package without bones",
                sinew_bones_pose(other_basis, other_workspace, other_controls, 0, maps, room, &details));
    say_details("bones with a workspace of the exact tier",
                sinew_bones_pose(basis, workspace, controls, 0, maps, room, &details));
    say("bones of another basis's controls", sinew_bones_pose(basis, bones, other_controls, 0, maps, room, NULL));
    say_details("bones in an unknown form", sinew_bones_pose(basis, bones, controls, 3, maps, room, &details));
    say("bones to NULL", sinew_bones_pose(basis, bones, controls, 0, NULL, room, NULL));
    say_numbers("bones to a short buffer", sinew_bones_pose(basis, bones, controls, 1, maps, room - 1, &details), room,
                room - 1);
    say_numbers("joints to a short buffer",
                sinew_bones_pose(basis, bones, controls, 2, maps, room - 2 * (size_t)info.bone_count - 1, &details),
                room - 2 * (size_t)info.bone_count, room - 2 * (size_t)info.bone_count - 1);
    say("bones into the workspace", sinew_bones_pose(basis, bones, controls, 0, (float *)(void *)bones, room, NULL));
    say("rest of a package without bones", sinew_bones_rest(other_basis, maps, room, NULL));
    say("rest to a short buffer", sinew_bones_rest(basis, maps, 10 * (size_t)info.bone_count - 1, NULL));
    say("rest into the package", sinew_bones_rest(basis, (float *)(void *)block.package, room, NULL));
    say("skin of a package without bones",
        sinew_bones_skin(other_basis, block.scratch, count, weights, count, NULL));
    say("skin with too few bones", sinew_bones_skin(basis, block.scratch, count - 1, weights, count, NULL));
    say("skin with too few weights", sinew_bones_skin(basis, block.scratch, count, weights, count - 1, NULL));
    say("skin with bones and weights in one place",
        sinew_bones_skin(basis, block.outs, count, weights, count, NULL));
}

static SinewBatch **batch_out;

static SinewStatus make_batch(const SinewInstance *instances, size_t count)
{
    return sinew_batch_create(basis, instances, count, sizeof *instances, block.scratch, BLOCK_BYTES, batch_out, &details);
}

static void batches(void)
{
    SinewInstance instances[2], good[2];
    SinewInstanceReport report = SINEW_INIT(SinewInstanceReport);
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
    instances[1].workspace = bones;
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
    must(sinew_close(batch));
    remember();
    say("play a closed batch", sinew_batch_play(basis, batch, &played, NULL));
}

int main(int argc, char **argv)
{
    SinewWorkspaceOptions options = SINEW_INIT(SinewWorkspaceOptions);
    prepare(argc, argv);
    options.tier = SINEW_TIER_BONES;
    must(sinew_workspace_layout(basis, &options, &bones_layout));
    must(sinew_workspace_create(basis, &options, block.outs + BLOCK_BYTES / 2, BLOCK_BYTES / 2, &bones, NULL));
    must(sinew_pins_layout(basis, 2, &pins_layout));
    must(sinew_pins_create(basis, 2, block.extra, BLOCK_BYTES, &pins, NULL));
    must(sinew_pins_create(other_basis, 2, block.structs + BLOCK_BYTES / 2, BLOCK_BYTES / 2, &other_pins, NULL));
    remember();
    tiers();
    posing();
    pinning();
    vertices();
    batches();
    return finish();
}
