/* CHOLMOD behind five functions: factor once, solve three right-hand sides many times with memory that is kept. */
#include <cholmod.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    cholmod_common common;
    cholmod_factor *factor;
    cholmod_dense *right;
    cholmod_dense *solution, *y, *e;
} peer;

/* mode: 0 simplicial LDL', 1 simplicial LL', 2 supernodal LL'. The matrix is the lower triangle, columns ascending. */
void *sinew_cholmod_new(int n, const int *offsets, const int *rows, const double *values, int mode) {
    peer *p = calloc(1, sizeof(peer));
    if (!p) {
        return NULL;
    }
    cholmod_start(&p->common);
    p->common.print = 0;
    p->common.supernodal = mode == 2 ? CHOLMOD_SUPERNODAL : CHOLMOD_SIMPLICIAL;
    p->common.final_ll = mode == 1;
    cholmod_sparse *a = cholmod_allocate_sparse(n, n, offsets[n], 1, 1, -1, CHOLMOD_REAL, &p->common);
    if (!a) {
        free(p);
        return NULL;
    }
    memcpy(a->p, offsets, sizeof(int) * (size_t)(n + 1));
    memcpy(a->i, rows, sizeof(int) * (size_t)offsets[n]);
    memcpy(a->x, values, sizeof(double) * (size_t)offsets[n]);
    p->factor = cholmod_analyze(a, &p->common);
    int ok = p->factor && cholmod_factorize(a, p->factor, &p->common) && p->common.status == CHOLMOD_OK;
    cholmod_free_sparse(&a, &p->common);
    p->right = ok ? cholmod_zeros(n, 3, CHOLMOD_REAL, &p->common) : NULL;
    if (!p->right) {
        cholmod_free_factor(&p->factor, &p->common);
        cholmod_finish(&p->common);
        free(p);
        return NULL;
    }
    return p;
}

/* The right-hand side: three columns of n, one after the other. */
double *sinew_cholmod_right(void *peer_pointer) {
    return ((peer *)peer_pointer)->right->x;
}

const double *sinew_cholmod_solve(void *peer_pointer) {
    peer *p = peer_pointer;
    int ok = cholmod_solve2(CHOLMOD_A, p->factor, p->right, NULL, &p->solution, NULL, &p->y, &p->e, &p->common);
    return ok ? p->solution->x : NULL;
}

void sinew_cholmod_free(void *peer_pointer) {
    peer *p = peer_pointer;
    cholmod_free_dense(&p->right, &p->common);
    cholmod_free_dense(&p->solution, &p->common);
    cholmod_free_dense(&p->y, &p->common);
    cholmod_free_dense(&p->e, &p->common);
    cholmod_free_factor(&p->factor, &p->common);
    cholmod_finish(&p->common);
    free(p);
}
