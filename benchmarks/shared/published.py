"""Published models for structural diagnosis, as the unknowns of each equation.

A line is an equation: its unknowns, then after `|` the faults that enter it. `d x = y` says that y is the rate of x.
Known signals and parameters do not appear. These are the models by which the fault diagnosis toolbox of Linköping
University (E. Frisk, M. Krysander) is tested and explained.
"""

from faultbond.diagnosability.structural import StructuralModel

# Two tanks with clogging and leaks, four sensors: Krysander and Frisk, in the toolbox' tests.
WATER_TANK = """
dh1 xc1 h1 | fa
dh2 xc1 xl2 h1 h2
h1
h2 | fh2
xc1 h1 | ff1
xl3 h2
xc1 | fc1
xl2 | fl2
xl3 | fl3
d h1 = dh1
d h2 = dh2
"""

# Three tanks in a row: Frisk and others, IEEE Trans. SMC-A 42 (2012), section II.
THREE_TANK = """
q1 p1 p2 | fV1
q2 p2 p3 | fV2
q3 p3 | fV3
dp1 q0 q1 | fT1
dp2 q1 q2 | fT2
dp3 q2 q3 | fT3
p1
q2
q0
d p1 = dp1
d p2 = dp2
d p3 = dp3
"""

# A direct current motor with current, speed and torque measured: toolbox, manual.
ELECTRIC_MOTOR = """
I dI w | fR
Tm I
dw T w
T Tm Tl
I | fi
w | fw
T | fT
d I = dI
d w = dw
"""

# An induction motor: toolbox, manual; after Aguilera and others.
INDUCTION_MOTOR = """
q_a w lambda_a
q_b w lambda_b
di_a i_a lambda_a q_b
di_b i_b lambda_b q_a
dlambda_a i_a lambda_a q_b
dlambda_b i_b lambda_b q_a
dw w i_a lambda_b i_b lambda_a Tl
d i_a = di_a
d i_b = di_b
d lambda_a = dlambda_a
d lambda_b = dlambda_b
d w = dw
i_a | f_a
i_b | f_b
w
"""

# Commault, Dion and Agha, Structural analysis for the sensor location problem, Safeprocess 2006.
COMMAULT = """
x5 | f1
x7 | f2
x6 | f4
x1 x5 x7
x2 x6 | f3
x1 x2 x3
x1 x2 x4
x3
x3 x4
x4
"""

# A linear model of five states: Krysander and Frisk, Sensor placement for fault diagnosis, IEEE Trans. SMC-A 38 (2008).
FIVE_STATES = """
dx1 x1 x2 x5
dx2 x2 x3 x4
dx3 x3 x5 | f1 f2
dx4 x4 x5 | f3
dx5 x5 | f4
d x1 = dx1
d x2 = dx2
d x3 = dx3
d x4 = dx4
d x5 = dx5
"""

# A turbocharged petrol engine, 94 equations: toolbox, use case; Eriksson and others.
ENGINE = """
W_ic p_c p_ic T_c
W_af p_amb p_af T_amb | fp_af
W_es p_amb p_t T_t
PSI_th p_im p_ic
W_th Aeff_th p_ic T_ic PSI_th
T_imcr T_ic
PI_wg p_t p_em
PSIli_wg PI_wg
W_wg Aeff_wg p_em Tflow_wg PSIli_wg
Tflow_wg p_t p_em T_em T_t
p_af m_af T_af
dmdt_af W_af W_c | fw_af
dTdt_af W_af T_amb T_af W_c m_af
d m_af = dmdt_af
d T_af = dTdt_af
p_c m_c T_c
dmdt_c W_c W_ic | fw_c
dTdt_c W_c T_cout T_c W_ic m_c
d m_c = dmdt_c
d T_c = dTdt_c
p_ic m_ic T_ic
dmdt_ic W_ic W_th
dTdt_ic W_ic T_fwd_flow_ic T_ic W_th m_ic
d m_ic = dmdt_ic
d T_ic = dTdt_ic
p_im m_im T_im
dmdt_im W_th W_ac | fw_th
dTdt_im W_th T_imcr T_im W_ac m_im
d m_im = dmdt_im
d T_im = dTdt_im
p_em m_em T_em
dmdt_em W_e W_twg
dTdt_em W_e T_ti T_em W_twg m_em
d m_em = dmdt_em
d T_em = dTdt_em
p_t m_t T_t
dmdt_t W_twg W_es
dTdt_t W_twg T_turb T_t W_es m_t
d m_t = dmdt_t
d T_t = dTdt_t
T_fwd_flow_ic T_amb T_c W_ic
Aeff_th alpha_th
W_ac eta_vol omega_e p_im T_im
T_in T_im
eta_vol C_eta_vol p_em p_im T_im T_in | fc_vol
C_eta_vol p_im
Tq_e_cs Tq_e_cb Tq_e_f Tq_e_p
Tq_e_cb eta_ign W_ig
Tq_e_f W_fr
Tq_e_p W_i_p
W_ig W_ac W_fc omega_e
W_fr FMEP
FMEP S_p BMEP
S_p omega_e
BMEP p_im
W_i_p p_em p_im
W_e W_fc W_ac
T_e W_e
T_ti T_amb T_e W_e
Tq_c W_c T_cout T_af omega_tc
W_c PI_cnolim p_af U_c T_af PHI_model
PHI_model PSI_c
PSI_c PI_c T_af U_c
PI_c p_c p_af
PI_cnolim p_c p_af
U_c omega_tc
T_cout T_af PI_c eta_c
eta_c W_ccorr PI_c
W_ccorr W_c T_af p_af
W_t p_em PI_t T_em
Tq_t eta_t W_t T_em PI_t omega_tc
eta_t omega_tc T_em W_t p_em dh_is
dh_is T_em PI_t
T_tout T_em eta_t PI_t
PI_t p_t p_em
T_turb W_t T_tout W_wg Tflow_wg
W_twg W_t W_wg
Aeff_wg wg_pos
dwgdt_pos u_wg wg_pos
d wg_pos = dwgdt_pos
eta_ign DELTA_theta
DELTA_theta omega_e p_im
domegadt_tc Tq_t Tq_c omega_tc | fw_t
d omega_tc = domegadt_tc
p_ic | fyp_ic
p_im | fyp_im
T_ic | fyT_ic
W_af | fyw_af
omega_e
alpha_th | fx_th
u_wg
W_fc
T_amb
p_amb
"""


def structure(table: str) -> StructuralModel:
    """Give the structural model of a table."""
    lines = [line.partition("|") for line in table.strip().splitlines()]
    differential = {k: left.split()[3:0:-2] for k, (left, _, _) in enumerate(lines) if left.startswith("d ")}
    contents = [differential.get(k, left.split()) for k, (left, _, _) in enumerate(lines)]
    variables = tuple(dict.fromkeys(name for content in contents for name in content))
    index = {name: k for k, name in enumerate(variables)}
    faults = [(fault, k) for k, (_, _, right) in enumerate(lines) for fault in right.split()]
    return StructuralModel(
        equations=tuple(tuple(sorted(index[name] for name in content)) for content in contents),
        n_variables=len(variables),
        faults=tuple(equation for _, equation in faults),
        differentials=tuple((k, index[rate], index[quantity]) for k, (rate, quantity) in differential.items()),
        variable_names=variables,
        equation_names=tuple(f"e{k + 1}" for k in range(len(lines))),
        fault_names=tuple(fault for fault, _ in faults),
    )
