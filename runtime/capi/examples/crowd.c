/* A crowd on threads: many instances of one package, each in a pose of its own, written as one OBJ.
 *
 *   crowd package.sinew crowd.obj [instances] [threads]
 *
 * Instances share the opened package. Each has a workspace, of the bones where the package has some, controls and positions.
 */
#include <pthread.h>

#include "example.h"
#include "sinew_batch.h"

enum { ROUNDS = 3, THREADS_MAX = 64 };

typedef struct {
    const SinewBasis *basis;
    const SinewBatch *batch;
    size_t played;
    SinewStatus status;
} Work;

static void *play(void *argument)
{
    Work *work = (Work *)argument;
    work->status = sinew_batch_play(work->basis, work->batch, &work->played, NULL);
    return NULL;
}

/* Another pose for every instance and round: weights from rest to the upper stop, by small whole numbers. */
static void pose(const SinewBasis *basis, SinewControls *controls, uint32_t control_count, size_t instance, size_t round)
{
    uint32_t control;
    for (control = 0; control < control_count; control++) {
        float maximum, share = (float)((3 * instance + 5 * control + 7 * round) % 11) / 10.0f;
        check("range", sinew_control_range(basis, control, NULL, &maximum), NULL);
        check("set", sinew_control_set(controls, control, share * maximum, NULL), NULL);
    }
}

/* One round: every thread plays until no instance is left. Returns how many were played. */
static size_t play_round(Work *work, size_t thread_count)
{
    pthread_t threads[THREADS_MAX];
    size_t n, played = 0;
    for (n = 0; n < thread_count; n++) {
        if (pthread_create(&threads[n], NULL, play, &work[n]) != 0) {
            fail("threads", "too many");
        }
    }
    for (n = 0; n < thread_count; n++) {
        pthread_join(threads[n], NULL);
        check("play", work[n].status, NULL);
        played += work[n].played;
    }
    return played;
}

int main(int argc, char **argv)
{
    SinewDetails details = SINEW_INIT(SinewDetails);
    SinewBasisInfo info = SINEW_INIT(SinewBasisInfo);
    SinewWorkspaceOptions options = SINEW_INIT(SinewWorkspaceOptions);
    SinewLayout basis_layout, workspace_layout, controls_layout, batch_layout;
    SinewBasis *basis;
    SinewBatch *batch;
    SinewControls **controls;
    SinewInstance *instances;
    Work work[THREADS_MAX];
    void *starts[4], *package, *memory;
    char *block;
    float *positions;
    size_t length, floats, n, round, instance_bytes;
    size_t instance_count = argc > 3 ? strtoul(argv[3], NULL, 10) : 16, thread_count = argc > 4 ? strtoul(argv[4], NULL, 10) : 2;

    if (argc < 3 || instance_count < 1 || instance_count > 10000 || thread_count < 1 || thread_count > THREADS_MAX) {
        fail("usage", "crowd package.sinew crowd.obj [instances, 1 to 10000] [threads, 1 to 64]");
    }
    package = read_file(argv[1], &length, &starts[0]);
    check("layout", sinew_basis_layout(&basis_layout), NULL);
    memory = allocate(basis_layout.size_bytes, &starts[1]);
    check(argv[1], sinew_basis_open(SINEW_ABI_VERSION, package, length, memory, basis_layout.size_bytes, &basis, &details),
          &details);
    check("info", sinew_basis_info(basis, &info), NULL);
    options.tier = info.bone_count > 0 ? SINEW_TIER_BONES : SINEW_TIER_EXACT;

    /* One block for all instances: sizes of handles are multiples of their alignment. */
    check("layout", sinew_workspace_layout(basis, &options, &workspace_layout), NULL);
    check("layout", sinew_controls_layout(basis, &controls_layout), NULL);
    instance_bytes = workspace_layout.size_bytes + controls_layout.size_bytes;
    block = (char *)allocate(instance_count * instance_bytes, &starts[2]);
    floats = 3 * (size_t)info.vertex_count;
    positions = (float *)calloc(instance_count * floats, sizeof *positions);
    instances = (SinewInstance *)calloc(instance_count, sizeof *instances);
    controls = (SinewControls **)calloc(instance_count, sizeof *controls);
    if (positions == NULL || instances == NULL || controls == NULL) {
        fail("memory", "none left");
    }
    for (n = 0; n < instance_count; n++) {
        char *own = block + n * instance_bytes;
        check("workspace", sinew_workspace_create(basis, &options, own, workspace_layout.size_bytes,
                                                  &instances[n].workspace, &details), &details);
        check("controls", sinew_controls_create(basis, own + workspace_layout.size_bytes, controls_layout.size_bytes,
                                                &controls[n], &details), &details);
        instances[n].controls = controls[n];
        instances[n].positions = positions + n * floats;
        instances[n].position_floats = floats;
    }
    check("layout", sinew_batch_layout(instance_count, &batch_layout), NULL);
    memory = allocate(batch_layout.size_bytes, &starts[3]);
    check("batch", sinew_batch_create(basis, instances, instance_count, sizeof *instances, memory, batch_layout.size_bytes,
                                      &batch, &details), &details);
    for (n = 0; n < thread_count; n++) {
        work[n].basis = basis;
        work[n].batch = batch;
    }

    for (round = 0; round < ROUNDS; round++) {
        for (n = 0; n < instance_count; n++) {
            pose(basis, controls[n], info.control_count, n, round);
        }
        printf("round %lu: %lu instances played\n", (unsigned long)round, (unsigned long)play_round(work, thread_count));
        check("begin", sinew_batch_begin(batch), NULL);
    }
    for (n = 0; n < instance_count; n++) {
        SinewInstanceReport report = SINEW_INIT(SinewInstanceReport);
        check("report", sinew_batch_report(batch, n, &report), NULL);
        check("instance", report.status, NULL);
    }
    write_obj(argv[2], basis, positions, NULL, (uint32_t)instance_count);

    free(controls);
    free(instances);
    free(positions);
    for (n = 0; n < 4; n++) {
        free(starts[n]);
    }
    return EXIT_SUCCESS;
}
