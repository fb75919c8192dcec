"""Energy of one base-pair step as an expression of five bead positions, for OpenMM.

Particles 1, 2, 3 are the centres of base pairs i, i+1, i+2; 4 and 5 the groove beads of i and
i+1. With t = r2 - r1, s = r3 - r2, p = r4 - r1, q = r5 - r2 the frames are d3 = t/|t|,
d1 = p without its part along t, normalised, d2 = d3 x d1, and likewise s, q for the next frame.
All entries of the step's rotation, entry (j, k) = d_j(i).d_k(i+1), are then scalar and triple
products of t, s, p, q over lengths. Written that way, and not as products of unit vectors, the
expressions stay small enough for OpenMM to differentiate them symbolically in about a second.
"""

from __future__ import annotations

from dnacheck.model.chain import StepForm

PARTICLES = 5
GROUND_PARAMETERS = ("tau_c", "tau_s", "tau_0", "theta_0", "phi_0", "phi_c", "phi_s")
DIAGONAL_PARAMETERS = ("k_tt", "k_hh", "k_pp")
# Rows of the upper Cholesky factor in the order theta, phi, tau: theta, whose expression is the
# largest, then occurs once, which halves the time OpenMM takes to differentiate.
COUPLED_PARAMETERS = ("u_hh", "u_hp", "u_ht", "u_pp", "u_pt", "u_tt")

_DIAGONAL = "0.5*k_tt*dtau^2 + 0.5*k_hh*dtheta^2 + 0.5*k_pp*dphi^2"
_COUPLED = (
    "0.5*(u_hh*dtheta + u_hp*dphi + u_ht*dtau)^2"
    " + 0.5*(u_pp*dphi + u_pt*dtau)^2 + 0.5*(u_tt*dtau)^2"
)

# R_tau R_theta R_phi of (2.1). sine and cosine of each angle carry a common positive factor,
# which atan2 ignores: |d1||d2'| for tau, |t||s||s x q| for theta and phi.
_WEDGE = """
dtau = atan2(sin_t*tau_c - cos_t*tau_s, cos_t*tau_c + sin_t*tau_s);
dtheta = theta - theta_0;
dphi = atan2(sin_p*phi_c - cos_p*phi_s, cos_p*phi_c + sin_p*phi_s);
theta = atan2(-tsq*sqrt(ss), sqrt(sin_p^2 + cos_p^2));
sin_t = (tp*tsq - tt*psq)/sqrt(tt);
cos_t = ts*pq - tq*ps;
sin_p = ts*sq - tq*ss;
cos_p = ts*sqrt(ss*qq - sq*sq);
"""

# The symmetrised step R_tau/2 R_theta/2 R_phi R_theta/2 R_tau/2 has a quaternion (x, y, z, w) with
# tan(theta/2) = -x/hypot(z, w) and sin(phi/2) = y; hypot(z, w) is the cosine of half the bend.
# qx, qy and qw below are 4w times x, y and w, so qw = 4w^2. The twist is that of parallel
# transport; its sine and cosine carry a common factor. Every name is used as seldom as can be,
# because OpenMM differentiates the expression with all names written out.
_MIDSTEP = """
dtau = atan2(sin_t, cos_t) - tau_0;
dtheta = 2*atan2(-qx/root, half) - theta_0;
dphi = 2*asin(y) - phi_0;
y = qy/root;
root = 2*sqrt(qw);
half = sqrt(0.5 + 0.5*ts/(lt*ls));
qw = 1 + ts/(lt*ls) + cos_t/(ln*ld);
qx = tsq/(lt*ld) - tps/(ln*ls);
qy = (ps*tt - tp*ts)/(lt*ln*ls) - (tq*ss - ts*sq)/(lt*ls*ld);
sin_t = (ss*tpq - sq*tps)/ls + (tp*tsq - tt*psq)/lt;
cos_t = (tt*(ss*pq - sq*ps) - tp*(ss*tq - sq*ts))/(lt*ls) + ts*pq - tq*ps;
lt = sqrt(tt); ls = sqrt(ss); ln = sqrt(tt*pp - tp*tp); ld = sqrt(ss*qq - sq*sq);
tps = tx*nx + ty*ny + tz*nz;
tpq = tx*(py*gz - pz*gy) + ty*(pz*gx - px*gz) + tz*(px*gy - py*gx);
nx = py*sz - pz*sy;
ny = pz*sx - px*sz;
nz = px*sy - py*sx;
pp = px*px + py*py + pz*pz;
"""

_PRODUCTS = """
tsq = tx*ex + ty*ey + tz*ez;
psq = px*ex + py*ey + pz*ez;
ex = sy*gz - sz*gy;
ey = sz*gx - sx*gz;
ez = sx*gy - sy*gx;
tt = tx*tx + ty*ty + tz*tz;
ss = sx*sx + sy*sy + sz*sz;
qq = gx*gx + gy*gy + gz*gz;
ts = tx*sx + ty*sy + tz*sz;
tp = tx*px + ty*py + tz*pz;
tq = tx*gx + ty*gy + tz*gz;
ps = px*sx + py*sy + pz*sz;
pq = px*gx + py*gy + pz*gz;
sq = sx*gx + sy*gy + sz*gz;
tx = x2 - x1; ty = y2 - y1; tz = z2 - z1;
sx = x3 - x2; sy = y3 - y2; sz = z3 - z2;
px = x4 - x1; py = y4 - y1; pz = z4 - z1;
gx = x5 - x2; gy = y5 - y2; gz = z5 - z2
"""

# Logarithm of the rotation group's volume element in the step angles; see docs/md.md.
_LOG_VOLUME = {
    "wedge": "log(cos(theta))",
    # cos(theta/2) cos(phi/2) is the cosine of half the bend.
    "midstep": "log(half) + 0.5*log(1 - y^2)",
}


def step_expression(form: StepForm, coupled: bool, flat_angles: bool) -> str:
    """OpenMM expression of the energy of one step, in kJ/mol.

    Parameters
    ----------
    form : {"wedge", "midstep"}
        How three angles make a rotation.
    coupled : bool
        Whether the stiffness has off-diagonal terms; parameters are then
        :data:`COUPLED_PARAMETERS`, else :data:`DIAGONAL_PARAMETERS`, each followed by
        :data:`GROUND_PARAMETERS`.
    flat_angles : bool
        Add RT ln(volume element), which turns the measure of the bead chain (rotations) into
        the flat measure of the angles; RT is the global parameter ``rt``.
    """
    energy = _COUPLED if coupled else _DIAGONAL
    if flat_angles:
        energy += f" + rt*({_LOG_VOLUME[form]})"
    body = _WEDGE if form == "wedge" else _MIDSTEP
    return f"{energy};{body}{_PRODUCTS}"
