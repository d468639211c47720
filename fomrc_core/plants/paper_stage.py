"""What the paper prints of its stage, a PI P-753.1CD on an E-625: Tables 1 to 3 and the figures of merit.

Liu, Shan, Gabbert, Qi: Smart Mater. Struct. 22 (2013) 115020. Nothing else of its measurements is public. Voltage is
at the controller's input, -2.5 to 2.5 V; errors are in percent of what docs/reproduction.md says.
"""

from __future__ import annotations

# Table 1: elements in the paper's order, the one that never saturates last.
KAPPA_UM_PER_V = (10.4571, 23.6702, 19.4110, 7.6675, 37.6126, 41.2519, 36.6254, 49.9662, 64.0682, 24.7827, 1.2808)
SATURATION_V = (0.0368, 0.0364, 0.0370, 0.0168, 0.0432, 0.0320, 0.0525, 0.0262, 0.0167, 0.1036)
CREEP_ORDER = 0.015
N_ELEMENTS = len(SATURATION_V)

# Table 2: height of the step [V] -> RMSE of the displacement at 60 s [%].
STEP_NRMSE_PERCENT = {2.5: 1.50, 1.5: 0.44, 0.5: 0.69, -0.5: 0.43, -1.5: 1.07, -2.5: 2.28}
# Table 3: slope of the triangle [V/s] -> NRMSE [%].
SLOPE_NRMSE_PERCENT = {
    0.1: 0.25,
    0.5: 0.25,
    1.0: 0.29,
    2.0: 0.32,
    5.0: 0.33,
    10.0: 0.40,
    20.0: 0.54,
    50.0: 0.95,
    100.0: 1.64,
    200.0: 3.03,
}
# Figure 14: NRMSE [%], and the largest error outside the transients of the steps [um].
STAIRCASE_NRMSE_PERCENT = 0.29
STAIRCASE_LARGEST_ERROR_UM = 0.05
# Figures 15 and 16, without and with compensation [%].
TRACKING_NRMSE_PERCENT = (5.04, 0.36)
NONLINEARITY_PERCENT = (12.06, 0.65)
