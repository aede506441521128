"""Coefficients of RODAS, order 4(3), L-stable and stiffly accurate.

Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, IV.7 and IV.10 (RODAS).
"""

GAMMA = 0.25
# alpha_i, gamma_i, and a_ij, c_ij of the transformed variables (IV.7), in which no stage multiplies by J
NODES = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
TIME_WEIGHTS = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
STAGES = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895),
)
COUPLING = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)

LEVER_M = 0.1  # turns an error in yaw rate into one in speed
