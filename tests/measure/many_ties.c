/* Measuring stick for the march of several masses: Newmark (beta, gamma), TIES masses on a body of MODES modes, the
 * track tabulated once for all cases, 8 cases abreast, one TIES x TIES system per step without pivoting.
 * Build: gcc -O3 -march=native -mprefer-vector-width=512 -ffp-contract=fast -shared -fPIC -DTIES=8 -DMODES=10
 * rows[n][tie][mode][4] = p, w, A, B of station n in step units, observed[mode]; per case of a block of 8: stiffness,
 * damping, start (acceleration of station 0, from rest) [mode][8], mass, load [tie][8]; peak[8] = max |observed.q|. */
#include <stddef.h>
typedef double row __attribute__((vector_size(64)));
#define EACH(i, count) for (int i = 0; i < (count); i++)

static inline row larger(row a, row b) { EACH(l, 8) a[l] = a[l] > b[l] ? a[l] : b[l]; return a; }

void march(int stations, double beta, double gamma, const double (*restrict rows)[TIES][MODES][4],
           const double *restrict observed, const row *restrict stiffness, const row *restrict damping,
           const row *restrict start, const row *restrict mass, const row *restrict load, row *restrict peak)
{
    row u[MODES], v[MODES], c[MODES], d[MODES], cd[MODES], kd[MODES], m[TIES][TIES], f[TIES], none = {0}, most = none;
    EACH(k, MODES) {
        d[k] = 1.0 / (1.0 + gamma * damping[k] + beta * stiffness[k]);
        cd[k] = damping[k] * d[k];
        kd[k] = stiffness[k] * d[k];
        u[k] = (0.5 - beta) * start[k];
        v[k] = (1.0 - gamma) * start[k];
        c[k] = cd[k] * v[k] + kd[k] * u[k];
    }
    for (int n = 1; n < stations; n++) {
        const double (*restrict at)[MODES][4] = rows[n];
        EACH(i, TIES) {
            row motion = none, product[TIES];
            EACH(s, TIES) product[s] = none;
            EACH(k, MODES) {
                motion += at[i][k][1] * c[k] - (at[i][k][2] * v[k] + at[i][k][3] * u[k]);
                row wd = at[i][k][1] * d[k];
                EACH(s, TIES) product[s] += at[s][k][0] * wd;
            }
            f[i] = load[i] + mass[i] * motion;
            EACH(s, TIES) m[i][s] = mass[i] * product[s];
            m[i][i] += 1.0;
        }
        EACH(i, TIES) {
            m[i][i] = 1.0 / m[i][i];
            for (int r = i + 1; r < TIES; r++) {
                row part = m[r][i] * m[i][i];
                f[r] -= part * f[i];
                for (int s = i + 1; s < TIES; s++) m[r][s] -= part * m[i][s];
            }
        }
        for (int i = TIES - 1; i >= 0; i--) {
            for (int s = i + 1; s < TIES; s++) f[i] -= m[i][s] * f[s];
            f[i] *= m[i][i];
        }
        row seen = none;
        EACH(k, MODES) {
            row push = none;
            EACH(i, TIES) push += at[i][k][0] * f[i];
            row a = d[k] * push - c[k], q = u[k] + beta * a, rate = v[k] + gamma * a;
            seen += observed[k] * q;
            v[k] = rate + (1.0 - gamma) * a;
            u[k] = q + rate + (0.5 - beta) * a;
            c[k] = cd[k] * v[k] + kd[k] * u[k];
        }
        most = larger(most, larger(seen, -seen));
    }
    *peak = most;
}
