/* Plays one pose of a package and writes it as an OBJ.
 *
 *   pose package.sinew pose.obj [control=weight ...]
 *
 * Without controls given, the first two stand halfway to their upper stops.
 */
#include "example.h"

/* "name=weight", clamped to the control's range. */
static void set_named(const SinewPlayer *player, const char *argument)
{
    char name[SINEW_NAME_BYTES], *end;
    const char *equals = strchr(argument, '=');
    uint32_t control;
    float weight;
    if (equals == NULL || (size_t)(equals - argument) >= sizeof name) {
        fail(argument, "should be control=weight");
    }
    memcpy(name, argument, (size_t)(equals - argument));
    name[equals - argument] = '\0';
    weight = (float)strtod(equals + 1, &end);
    if (end == equals + 1 || *end != '\0') {
        fail(argument, "the weight is not a number");
    }
    check(name, sinew_control_find(player->basis, name, &control), NULL);
    check(argument, sinew_control_set(player->controls, control, weight, NULL), NULL);
}

static void print_controls(const SinewPlayer *player)
{
    uint32_t control;
    for (control = 0; control < player->control_count; control++) {
        char name[SINEW_NAME_BYTES];
        float weight, minimum, maximum;
        uint32_t level;
        check("name", sinew_control_name(player->basis, control, name, sizeof name), NULL);
        check("range", sinew_control_range(player->basis, control, &minimum, &maximum), NULL);
        check("parent", sinew_control_parent(player->basis, control, NULL, &level), NULL);
        check("get", sinew_control_get(player->controls, control, &weight), NULL);
        printf("%*s%s = %g (%g to %g)\n", (int)(2 * level), "", name, weight, minimum, maximum);
    }
}

int main(int argc, char **argv)
{
    SinewDetails details = SINEW_INIT(SinewDetails);
    SinewPlayer player = SINEW_INIT(SinewPlayer);
    SinewFrameOptions frame = SINEW_INIT(SinewFrameOptions);
    SinewLayout layout;
    void *starts[4], *package, *memory;
    size_t length, floats;
    uint32_t control;
    int argument;

    if (argc < 3) {
        fail("usage", "pose package.sinew pose.obj [control=weight ...]");
    }
    package = read_file(argv[1], &length, &starts[0]);
    check(argv[1], sinew_player_layout(package, length, NULL, &layout, &details), &details);
    memory = allocate(layout.size_bytes, &starts[1]);
    check(argv[1], sinew_player_open(SINEW_ABI_VERSION, package, length, NULL, memory, layout.size_bytes, &player, &details),
          &details);

    for (argument = 3; argument < argc; argument++) {
        set_named(&player, argv[argument]);
    }
    for (control = 0; argc == 3 && control < 2 && control < player.control_count; control++) {
        float maximum;
        check("range", sinew_control_range(player.basis, control, NULL, &maximum), NULL);
        check("set", sinew_control_set(player.controls, control, 0.5f * maximum, NULL), NULL);
    }
    print_controls(&player);

    floats = 3 * (size_t)player.vertex_count;
    frame.positions = (float *)allocate(floats * sizeof(float), &starts[2]);
    frame.position_floats = floats;
    frame.normals = (float *)allocate(floats * sizeof(float), &starts[3]);
    frame.normal_floats = floats;
    check("frame", sinew_frame(player.basis, player.workspace, player.controls, &frame, NULL, &details), &details);
    write_obj(argv[2], player.basis, frame.positions, frame.normals, 1);

    for (argument = 0; argument < 4; argument++) {
        free(starts[argument]);
    }
    return EXIT_SUCCESS;
}
