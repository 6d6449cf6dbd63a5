/* Every wrong use of packages, workspaces, controls and frames that the header names, one line each: what was done, and the
 * status that came back.
 *
 *   misuse baked.sinew other.sinew compact.sinew
 *
 * `tests/c_programs.rs` runs this and compares the lines with `tests/misuse.txt`.
 */
#include "misuse.h"

static SinewStatus open_bytes(const uint8_t *bytes, size_t length, SinewDetails *more)
{
    SinewBasis **out = (SinewBasis **)(void *)block.outs;
    return sinew_basis_open(SINEW_ABI_VERSION, bytes, length, block.scratch, BLOCK_BYTES, out, more);
}

static void opening(void)
{
    SinewBasis **out = (SinewBasis **)(void *)block.outs;
    uint8_t *memory = block.scratch, *bytes = block.package;
    size_t length = package_bytes, room = BLOCK_BYTES;
    uint8_t kept;

    say("basis layout to NULL", sinew_basis_layout(NULL));
    say("basis layout to a misaligned place", sinew_basis_layout((SinewLayout *)(void *)(block.outs + 1)));
    say_details("open with the header of another version",
                sinew_basis_open(SINEW_ABI_VERSION + 1, bytes, length, memory, room, out, &details));
    say("open NULL bytes", sinew_basis_open(SINEW_ABI_VERSION, NULL, length, memory, room, out, NULL));
    say("open into NULL memory", sinew_basis_open(SINEW_ABI_VERSION, bytes, length, NULL, room, out, NULL));
    say("open with a NULL result", sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory, room, NULL, NULL));
    say("open into misaligned memory", sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory + 8, room, out, NULL));
    say_numbers("open into short memory", sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory,
                                                           basis_layout.size_bytes - 1, out, &details),
                basis_layout.size_bytes, basis_layout.size_bytes - 1);
    say("open into memory of impossible length",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory, SIZE_MAX, out, NULL));
    say("open bytes of impossible length",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, SIZE_MAX / 2 + 1, memory, room, out, NULL));
    say("open into the package itself",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, length, bytes + 64, room, out, NULL));
    say("open with the result in the memory",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory, room, (SinewBasis **)(void *)(memory + 64), NULL));
    say("open with the result in the package",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory, room, (SinewBasis **)(void *)(bytes + 64), NULL));
    ((SinewDetails *)(void *)(memory + 64))->struct_bytes = sizeof details;
    remember();
    say("open with the details in the memory",
        sinew_basis_open(SINEW_ABI_VERSION, bytes, length, memory, room, out, (SinewDetails *)(void *)(memory + 64)));
    details.struct_bytes = 0;
    say("open with details of size 0", open_bytes(bytes, length, &details));
    details.struct_bytes = sizeof details - 8;
    say("open with details too small", open_bytes(bytes, length, &details));
    details.struct_bytes = (size_t)1 << 40;
    say("open with details of a garbage size", open_bytes(bytes, length, &details));

    say_details("open no bytes", open_bytes(bytes, 0, &details));
    say_details("open a header only", open_bytes(bytes, 63, &details));
    say_numbers("open a truncated package", open_bytes(bytes, length - 1, &details), length, length - 1);
    say_reason("open a truncated package", open_bytes(bytes, length - 1, &details));
    say_numbers("open a package and a byte", open_bytes(bytes, length + 1, &details), length, length + 1);
    memcpy(block.scratch + 4096 + 1, bytes, length);
    remember();
    say_details("open a misaligned package",
                sinew_basis_open(SINEW_ABI_VERSION, block.scratch + 4096 + 1, length, memory, 4096, out, &details));
    say_details("open a compact package", open_bytes(block.compact, compact_bytes, &details));
    kept = bytes[0];
    bytes[0] = 'x';
    remember();
    say_reason("open something else", open_bytes(bytes, length, &details));
    bytes[0] = kept;
    bytes[20] ^= 1;
    remember();
    say_reason("open a package with a damaged header", open_bytes(bytes, length, &details));
    bytes[20] ^= 1;
    bytes[length / 2] ^= 1;
    remember();
    say_reason("open a damaged package", open_bytes(bytes, length, &details));
    bytes[length / 2] ^= 1;
    remember();
    say("open the package", open_bytes(bytes, length, NULL));
}

static void creating(void)
{
    SinewWorkspace **out = (SinewWorkspace **)(void *)block.outs;
    SinewControls **controls_out = (SinewControls **)(void *)block.outs;
    uint8_t *memory = block.scratch;
    size_t size = workspace_layout.size_bytes;
    say("workspace layout of NULL", sinew_workspace_layout(NULL, NULL, (SinewLayout *)(void *)block.outs));
    say("workspace layout to NULL", sinew_workspace_layout(basis, NULL, NULL));
    say("workspace layout into the package", sinew_workspace_layout(basis, NULL, (SinewLayout *)(void *)block.package));
    say("workspace layout into the basis", sinew_workspace_layout(basis, NULL, (SinewLayout *)(void *)block.basis));
    say("workspace of NULL", sinew_workspace_create(NULL, NULL, memory, size, out, NULL));
    say("workspace in NULL memory", sinew_workspace_create(basis, NULL, NULL, size, out, NULL));
    say("workspace with a NULL result", sinew_workspace_create(basis, NULL, memory, size, NULL, NULL));
    say("workspace in misaligned memory", sinew_workspace_create(basis, NULL, memory + 4, BLOCK_BYTES, out, NULL));
    say("workspace in short memory", sinew_workspace_create(basis, NULL, memory, size - 1, out, &details));
    say("workspace in the package", sinew_workspace_create(basis, NULL, block.package, BLOCK_BYTES, out, NULL));
    say("workspace over the basis", sinew_workspace_create(basis, NULL, block.basis, BLOCK_BYTES, out, NULL));
    say("workspace of a workspace", sinew_workspace_create((SinewBasis *)(void *)workspace, NULL, memory, size, out, NULL));
    size = controls_layout.size_bytes;
    say("controls layout to NULL", sinew_controls_layout(basis, NULL));
    say("controls in short memory", sinew_controls_create(basis, memory, size - 1, controls_out, NULL));
    say("controls in misaligned memory", sinew_controls_create(basis, memory + 32, BLOCK_BYTES, controls_out, NULL));
    say("controls in the package", sinew_controls_create(basis, block.package, BLOCK_BYTES, controls_out, NULL));
    say("controls of NULL", sinew_controls_create(NULL, memory, size, controls_out, NULL));
}

static void asking(void)
{
    char name[SINEW_NAME_BYTES + 1];
    uint32_t control = 7;
    float *out = (float *)(void *)block.outs;
    uint32_t count = info.control_count;
    SinewBasisInfo *asked = (SinewBasisInfo *)(void *)block.structs;
    asked->struct_bytes = 3;
    remember();
    say("info with a wrong size", sinew_basis_info(basis, asked));
    say("info to NULL", sinew_basis_info(basis, NULL));
    say("info of NULL", sinew_basis_info(NULL, asked));
    say("faces to NULL", sinew_basis_faces(basis, 0, NULL, 3 * (size_t)info.face_count));
    say("faces to a short buffer", sinew_basis_faces(basis, 0, (uint32_t *)(void *)block.outs, 3 * (size_t)info.face_count - 1));
    say("faces into the package", sinew_basis_faces(basis, 0, (uint32_t *)(void *)block.package, BLOCK_BYTES / 4));
    say("faces in an unknown winding", sinew_basis_faces(basis, -1, (uint32_t *)(void *)block.outs, BLOCK_BYTES / 4));
    say("name beyond the last", sinew_control_name(basis, count, name, sizeof name));
    say("name to NULL", sinew_control_name(basis, 0, NULL, 65));
    say("name to a short buffer", sinew_control_name(basis, 0, name, 1));
    say("name to no buffer", sinew_control_name(basis, 0, name, 0));
    say("name into the package", sinew_control_name(basis, 0, (char *)block.package, 65));
    say("find NULL", sinew_control_find(basis, NULL, &control));
    say("find to NULL", sinew_control_find(basis, "c0", NULL));
    say("find no such", sinew_control_find(basis, "no such", &control));
    say("find nothing", sinew_control_find(basis, "", &control));
    say("find bytes that are no text", sinew_control_find(basis, "\xff\xfe", &control));
    memset(name, 'c', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    say("find a name too long", sinew_control_find(basis, name, &control));
    say("range beyond the last", sinew_control_range(basis, count, out, out + 1));
    say("range to one place", sinew_control_range(basis, 0, out, out));
    say("parent beyond the last", sinew_control_parent(basis, UINT32_MAX, &control, NULL));
    printf("the index stands at %lu\n", (unsigned long)control);
}

static void setting(void)
{
    float *weights = (float *)(void *)block.structs, *out = (float *)(void *)block.outs;
    uint32_t k, count = info.control_count;
    must(sinew_control_set(controls, 0, 0.25f, NULL));
    for (k = 0; k < count + 1; k++) {
        weights[k] = 0.1f;
    }
    remember();
    say("set NULL controls", sinew_control_set(NULL, 0, 0.5f, out));
    say("set beyond the last", sinew_control_set(controls, count, 0.5f, out));
    say("set NaN", sinew_control_set(controls, 0, NAN, out));
    say("set infinity", sinew_control_set(controls, 0, INFINITY, out));
    say("set minus infinity unclamped", sinew_control_set_unclamped(controls, 0, -INFINITY));
    say("set unclamped beyond the last", sinew_control_set_unclamped(controls, UINT32_MAX, 0.0f));
    say("set with the result in the controls",
        sinew_control_set(controls, 0, 0.5f, (float *)(void *)(block.controls + 64)));
    say("set with a misaligned result", sinew_control_set(controls, 0, 0.5f, (float *)(void *)(block.outs + 1)));
    say("get beyond the last", sinew_control_get(controls, count, out));
    say("get to NULL", sinew_control_get(controls, 0, NULL));
    say("set all from NULL", sinew_controls_set_all(controls, NULL, count, NULL));
    say_details("set too few", sinew_controls_set_all(controls, weights, count - 1, &details));
    say_details("set too many", sinew_controls_set_all(controls, weights, count + 1, &details));
    say("set all from the controls",
        sinew_controls_set_all(controls, (float *)(void *)(block.controls + 64), count, NULL));
    weights[2] = NAN;
    remember();
    say_details("set all with a NaN", sinew_controls_set_all(controls, weights, count, &details));
    say("get all to a short buffer", sinew_controls_get_all(controls, out, count - 1));
    say("get all into the controls", sinew_controls_get_all(controls, (float *)(void *)(block.controls + 64), count));
    say("get all of impossible length", sinew_controls_get_all(controls, out, SIZE_MAX));
    say("reset NULL", sinew_controls_reset(NULL));
    say("carry from NULL", sinew_controls_carry(basis, NULL, other_basis, other_controls, NULL));
    say("carry to NULL", sinew_controls_carry(basis, controls, other_basis, NULL, NULL));
    say("carry from no basis", sinew_controls_carry(NULL, controls, other_basis, other_controls, NULL));
    say("carry from another basis's controls", sinew_controls_carry(basis, other_controls, other_basis, controls, NULL));
    say("carry to another basis's controls", sinew_controls_carry(other_basis, other_controls, other_basis, controls, NULL));
    say("carry to the same controls", sinew_controls_carry(basis, controls, basis, controls, NULL));
    say("carry with the count in the controls",
        sinew_controls_carry(basis, controls, other_basis, other_controls, (uint32_t *)(void *)(block.controls + 64)));
}

static SinewFrameOptions frame_options(void)
{
    SinewFrameOptions options = SINEW_INIT(SinewFrameOptions);
    options.positions = (float *)(void *)block.positions;
    options.position_floats = floats;
    options.normals = (float *)(void *)block.normals;
    options.normal_floats = floats;
    return options;
}

static void players(void)
{
    SinewPlayer *player = (SinewPlayer *)(void *)block.structs;
    SinewWorkspaceOptions options = SINEW_INIT(SinewWorkspaceOptions);
    SinewFrameOptions frame = frame_options();
    SinewLayout layout;
    uint8_t *memory = block.scratch, *bytes = block.package;
    size_t length = package_bytes, size;
    must(sinew_player_layout(bytes, length, NULL, &layout, NULL));
    size = layout.size_bytes;
    player->struct_bytes = sizeof *player;
    remember();
    say("player layout to NULL", sinew_player_layout(bytes, length, NULL, NULL, NULL));
    say("player layout of NULL bytes", sinew_player_layout(NULL, length, NULL, &layout, NULL));
    say_details("player layout of no bytes", sinew_player_layout(NULL, 0, NULL, &layout, &details));
    say_details("player layout of a compact package",
                sinew_player_layout(block.compact, compact_bytes, NULL, &layout, &details));
    say("player layout into the package", sinew_player_layout(bytes, length, NULL, (SinewLayout *)(void *)bytes, NULL));
    options.tier = SINEW_TIER_BONES;
    say_details("player layout of a tier that is not there",
                sinew_player_layout(block.other, other_bytes, &options, &layout, &details));
    options.tier = 77;
    say_details("player of an unknown tier", sinew_player_open(SINEW_ABI_VERSION, bytes, length, &options, memory, size,
                                                               player, &details));
    say_details("player with the header of another version",
                sinew_player_open(SINEW_ABI_VERSION + 1, bytes, length, NULL, memory, size, player, &details));
    say("player to NULL", sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory, size, NULL, NULL));
    say("player in NULL memory", sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, NULL, size, player, NULL));
    say("player in misaligned memory",
        sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory + 16, BLOCK_BYTES - 16, player, NULL));
    say_numbers("player in short memory",
                sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory, size - 1, player, &details), size,
                size - 1);
    say("player in the package", sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, bytes, size, player, NULL));
    say("player in its own struct",
        sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, block.structs, BLOCK_BYTES, player, NULL));
    player->struct_bytes = 1;
    remember();
    say("player of a wrong size", sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory, size, player, NULL));
    player->struct_bytes = sizeof *player;
    must(sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory, size, player, NULL));
    remember();
    say("player", SINEW_STATUS_OK);
    say("set a control beyond the player's last", sinew_control_set(player->controls, player->control_count, 0.0f, NULL));
    say("a player's workspace with other controls",
        sinew_frame(player->basis, player->workspace, other_controls, &frame, NULL, NULL));
}

static void playing_with_handles(void)
{
    SinewFrameOptions options = frame_options();
    SinewWorkspace *moved = (SinewWorkspace *)(void *)block.scratch;
    memcpy(block.scratch, block.workspace, workspace_layout.size_bytes);
    remember();
    say("frame without basis", sinew_frame(NULL, workspace, controls, &options, NULL, NULL));
    say("frame without workspace", sinew_frame(basis, NULL, controls, &options, NULL, NULL));
    say("frame without controls", sinew_frame(basis, workspace, NULL, &options, NULL, NULL));
    say("frame with a workspace for a basis",
        sinew_frame((SinewBasis *)(void *)workspace, workspace, controls, &options, NULL, NULL));
    say_details("frame with controls for a workspace",
                sinew_frame(basis, (SinewWorkspace *)(void *)controls, controls, &options, NULL, &details));
    say("frame with a basis for controls",
        sinew_frame(basis, workspace, (SinewControls *)(void *)basis, &options, NULL, NULL));
    say("frame with floats for controls",
        sinew_frame(basis, workspace, (SinewControls *)(void *)block.positions, &options, NULL, NULL));
    say("frame with a misaligned workspace",
        sinew_frame(basis, (SinewWorkspace *)(void *)(block.workspace + 1), controls, &options, NULL, NULL));
    say("frame with a copied workspace", sinew_frame(basis, moved, controls, &options, NULL, NULL));
    say_details("frame with another basis's workspace",
                sinew_frame(basis, other_workspace, controls, &options, NULL, &details));
    say_details("frame with another basis's controls",
                sinew_frame(basis, workspace, other_controls, &options, NULL, &details));
    say("frame with another basis", sinew_frame(other_basis, workspace, controls, &options, NULL, NULL));
    block.workspace[workspace_layout.size_bytes - 1] ^= 1;
    remember();
    say("frame with a workspace written over its end", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    block.workspace[workspace_layout.size_bytes - 1] ^= 1;
    must(sinew_frame(basis, workspace, controls, &options, NULL, NULL));
}

static void playing_with_buffers(void)
{
    SinewFrameOptions options = frame_options();
    struct {
        SinewFrameOptions known;
        size_t newer;
    } longer;
    SinewFrameReport *report = (SinewFrameReport *)(void *)block.structs;
    report->struct_bytes = sizeof *report;
    remember();
    say("frame without options", sinew_frame(basis, workspace, controls, NULL, NULL, NULL));
    options.struct_bytes = 0;
    say("frame with options of size 0", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options.struct_bytes = sizeof options - sizeof(size_t);
    say_details("frame with short options", sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options.struct_bytes = sizeof options + 1;
    say("frame with options of an odd size", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options = frame_options();
    options.positions = NULL;
    say("frame without positions", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options = frame_options();
    options.position_floats = floats - 1;
    say_details("frame with short positions", sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options = frame_options();
    options.normal_floats = 0;
    say_details("frame with short normals", sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options = frame_options();
    options.position_floats = SIZE_MAX / 4;
    say("frame with positions of impossible length", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options = frame_options();
    options.positions = (float *)(void *)(block.positions + 2);
    say("frame with misaligned positions", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options = frame_options();
    options.normals = options.positions + floats - 1;
    say_details("frame with normals over positions", sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options = frame_options();
    options.positions = (float *)(void *)block.package;
    say_details("frame with positions in the package",
                sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options.positions = (float *)(void *)(block.workspace + 256);
    say_details("frame with positions in the workspace",
                sinew_frame(basis, workspace, controls, &options, NULL, &details));
    options.positions = (float *)(void *)block.controls;
    say("frame with positions in the controls", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options.positions = (float *)(void *)block.basis;
    say("frame with positions in the basis", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    options.positions = (float *)(void *)block.structs;
    say("frame with positions in the report", sinew_frame(basis, workspace, controls, &options, report, NULL));
    options = frame_options();
    report->struct_bytes = 1;
    remember();
    say("frame with a report of a wrong size", sinew_frame(basis, workspace, controls, &options, report, NULL));
    report->struct_bytes = sizeof *report;
    longer.known = frame_options();
    longer.known.struct_bytes = sizeof longer;
    longer.newer = 1;
    remember();
    say_details("frame with an option of the future",
                sinew_frame(basis, workspace, controls, &longer.known, NULL, &details));
    longer.newer = 0;
    say("frame with longer options that ask for nothing",
        sinew_frame(basis, workspace, controls, &longer.known, NULL, NULL));
}

static void playing_with_numbers(void)
{
    SinewFrameOptions options = frame_options();
    float *weight = (float *)(void *)(block.controls + 64), *resting = (float *)(void *)block.structs;
    const float quarter = 0.25f;
    uint32_t k;
    must(sinew_control_set(controls, 0, quarter, NULL));
    must(sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    /* Finds the weight in the controls' memory and writes over it. */
    while (memcmp(weight, &quarter, sizeof quarter) != 0) {
        weight++;
    }
    *weight = NAN;
    remember();
    say_details("frame with a NaN written over a weight",
                sinew_frame(basis, workspace, controls, &options, NULL, &details));
    *weight = quarter;

    /* The other package's values are so large that these weights overflow. The one refusal that writes: the rest shape. */
    must(sinew_frame(other_basis, other_workspace, other_controls, &options, NULL, NULL));
    memcpy(resting, block.positions, floats * sizeof(float));
    for (k = 0; k < info.control_count; k++) {
        must(sinew_control_set_unclamped(other_controls, k, FLT_MAX));
    }
    printf("frame with weights that overflow: %s\n",
           sinew_status_name(sinew_frame(other_basis, other_workspace, other_controls, &options, NULL, NULL)));
    printf("  %s\n", memcmp(resting, block.positions, floats * sizeof(float)) == 0 ? "at rest" : "not at rest");
    must(sinew_controls_reset(other_controls));
    must(sinew_frame(other_basis, other_workspace, other_controls, &options, NULL, NULL));
    remember();
}

static void reopening(void)
{
    SinewFrameOptions options = frame_options();
    size_t size = basis_layout.size_bytes;
    must(sinew_basis_open(SINEW_ABI_VERSION, block.other, other_bytes, block.basis, size, &basis, NULL));
    remember();
    say("frame after other content was opened", sinew_frame(basis, workspace, controls, &options, NULL, NULL));
    must(sinew_basis_open(SINEW_ABI_VERSION, block.package, package_bytes, block.basis, size, &basis, NULL));
    say("frame after the same content was opened again",
        sinew_frame(basis, workspace, controls, &options, NULL, NULL));
}

static void closing(void)
{
    SinewFrameOptions options = frame_options();
    remember();
    say("close NULL", sinew_close(NULL));
    say("close a handle of which only a copy is there",
        (memcpy(block.scratch, block.controls, controls_layout.size_bytes), remember(), sinew_close(block.scratch)));
    say("close what is no handle", sinew_close(block.positions));
    say("close a misaligned handle", sinew_close(block.workspace + 1));
    must(sinew_close(workspace));
    remember();
    say("close twice", sinew_close(workspace));
    say_details("frame with a closed workspace", sinew_frame(basis, workspace, controls, &options, NULL, &details));
    must(sinew_close(controls));
    remember();
    say("set closed controls", sinew_control_set(controls, 0, 0.0f, NULL));
    must(sinew_close(basis));
    remember();
    say("ask a closed basis", sinew_control_range(basis, 0, NULL, NULL));
    memset(block.other_basis, 0, BLOCK_BYTES);
    remember();
    say("ask a basis whose memory was zeroed", sinew_control_range(other_basis, 0, NULL, NULL));
    say("the text of no status", SINEW_STATUS_OK);
    printf("  %s, %s\n", sinew_status_text(12345), sinew_status_name(-1));
}

int main(int argc, char **argv)
{
    prepare(argc, argv);
    opening();
    creating();
    asking();
    setting();
    players();
    playing_with_handles();
    playing_with_buffers();
    playing_with_numbers();
    reopening();
    closing();
    return finish();
}
