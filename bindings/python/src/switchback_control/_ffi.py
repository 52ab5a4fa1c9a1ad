"""The C interface, generated from include/api.json by tools/gen_ffi.py; do not edit."""

# fmt: off
from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_int32, c_int64, c_uint64, c_void_p
from enum import IntEnum

VERSION = (0, 2, 0)


class Names(IntEnum):
    """Numbers that print as their names."""

    def __str__(self):
        return self.name.lower()

    def __format__(self, spec):
        return format(str(self), spec)


class RkFamily(Names):
    """enum swb_rk_family"""

    RADAU_IIA = 0
    GAUSS_LEGENDRE = 1
    EXPLICIT = 2
    RADAU_IA = 3
    LOBATTO_IIIA = 4
    LOBATTO_IIIB = 5
    LOBATTO_IIIC = 6


class DcsForm(Names):
    """enum swb_dcs_form"""

    AUTO = 0
    STEWART = 1
    HEAVISIDE = 2


class Discretisation(Names):
    """enum swb_discretisation"""

    FESD = 0
    STANDARD = 1


class StageForm(Names):
    """enum swb_stage_form"""

    AUTO = 0
    VALUES = 1
    DERIVATIVES = 2


class Cross(Names):
    """enum swb_cross"""

    ELEMENT = 0
    STAGE = 1
    FULL = 2
    POINT = 3


class StepEquilibration(Names):
    """enum swb_step_equilibration"""

    NONE = 0
    MEAN = 1
    DIFFERENCE = 2
    ETA_PRODUCT = 3
    ETA_SQUARED = 4
    ETA_EQUATION = 5
    ETA_SATURATED = 6


class Polish(Names):
    """enum swb_polish"""

    OFF = 0
    ON = 1


class InitialGuess(Names):
    """enum swb_initial_guess"""

    CONSTANT = 0
    SIMULATION = 1
    SMOOTHED = 2
    TIME_STEPPING = 3


class OcpStart(Names):
    """enum swb_ocp_start"""

    PORTFOLIO = 0
    HOMOTOPY = 1
    SMOOTHING = 2


class Portfolio(Names):
    """enum swb_portfolio"""

    OFF = 0
    RESCUE = 1
    ALL = 2
    AGREE = 3


class LinearSolver(Names):
    """enum swb_linear_solver"""

    AUTO = 0
    SUITESPARSE = 1
    FAER = 2
    NATIVE = 3


class Ordering(Names):
    """enum swb_ordering"""

    AMD = 0
    NATURAL = 1


class Sensitivity(Names):
    """enum swb_sensitivity"""

    OFF = 0
    ON = 1
    INPUTS = 2


class Toggle(Names):
    """enum swb_toggle"""

    OFF = 0
    ON = 1


class Relaxation(Names):
    """enum swb_relaxation"""

    SCHOLTES = 0
    SCHOLTES_EQ = 1
    SCHOLTES_LUMPED = 2
    LIN_FUKUSHIMA = 3
    KADRANI = 4
    STEFFENSEN_ULBRICH = 5
    STEFFENSEN_ULBRICH_POLY = 6
    KANZOW_SCHWARTZ = 7
    FISCHER_BURMEISTER = 8
    NATURAL_RESIDUAL = 9
    CHEN_CHEN_KANZOW = 10
    TWO_SIDED = 11
    RAGHUNATHAN_BIEGLER = 12
    L1_PENALTY = 13
    LINF_PENALTY = 14
    L1_ELASTIC = 15
    ELASTIC = 16
    DIRECT = 17


class Homotopy(Names):
    """enum swb_homotopy"""

    COUPLED = 0
    OUTER = 1


class Integration(Names):
    """enum swb_integration"""

    AUTO = 0
    DP5 = 1
    DOP853 = 2
    RADAU5 = 3


class ZenoPolicy(Names):
    """enum swb_zeno_policy"""

    CONTINUE = 0
    STOP = 1
    TIME_STEPPING = 2


class AmbiguityPolicy(Names):
    """enum swb_ambiguity_policy"""

    FIRST = 0
    STOP = 1
    PREFER = 2


class Selection(Names):
    """enum swb_selection"""

    BILINEAR = 0
    MOMENTS = 1
    NORM = 2
    FEWEST = 3


class LogLevel(Names):
    """enum swb_log_level"""

    SILENT = 0
    ERROR = 1
    WARNING = 2
    INFO = 3
    DEBUG = 4
    TRACE = 5


class Status(Names):
    """enum swb_status"""

    OK = 0
    NULL = -1
    DIMENSION = -2
    RANGE = -3
    STATE = -4
    UNSUPPORTED = -5
    OPTION = -6
    USER = -20
    NONFINITE = -21
    INTERRUPTED = -23
    NUMERIC = -30
    LIBRARY = -50
    INTERNAL = -99


class Kind(Names):
    """enum swb_kind"""

    INT = 0
    FLOAT = 1
    ENUM = 2


class Outcome(Names):
    """enum swb_outcome"""

    SOLVED = 0
    MAX_ITER = 1
    MAX_TIME = 2
    STOPPED = 3
    INFEASIBLE = 4
    STALLED = 5
    DIVERGING = 6
    FAILED = 7
    NOT_FOLLOWED = 8
    LOCALLY_INFEASIBLE = 9


class Polished(Names):
    """enum swb_polished"""

    NONE = 0
    DONE = 1
    REJECTED = 2


class Input(Names):
    """enum swb_input"""

    X = 1
    U = 2
    P = 4
    T = 8


class FunctionFlag(Names):
    """enum swb_function_flag"""

    SERIAL = 1


class Operator(Names):
    """enum swb_operator"""

    NEG = 0
    SQRT = 1
    EXP = 2
    LOG = 3
    SIN = 4
    COS = 5
    TAN = 6
    ASIN = 7
    ACOS = 8
    ATAN = 9
    SINH = 10
    COSH = 11
    TANH = 12
    ERF = 13
    FLOOR = 14
    ADD = 20
    SUB = 21
    MUL = 22
    DIV = 23
    POW = 24
    ATAN2 = 25
    POSITIVE = 40
    NOT = 41
    AND = 42
    OR = 43
    WHERE = 44
    SIGN = 45
    ABS = 46
    MIN = 47
    MAX = 48
    CLIP = 49
    RELAY = 50
    DEAD_ZONE = 51


class Table(Names):
    """enum swb_table"""

    STEPS = 0
    LINES = 1
    SPLINE = 2


class SwitchKind(Names):
    """enum swb_switch_kind"""

    CROSS = 0
    ENTER = 1
    LEAVE = 2


class RunOutcome(Names):
    """enum swb_run_outcome"""

    REACHED = 0
    MAX_STEPS = 1
    STEP_TOO_SMALL = 2
    ZENO = 3
    AMBIGUOUS = 4
    NO_CONTINUATION = 5
    EVENT = 6
    STOPPED = 100


class EventKind(Names):
    """enum swb_event_kind"""

    CROSS = 0
    ENTER = 1
    LEAVE = 2
    SPONTANEOUS = 3


class Direction(Names):
    """enum swb_direction"""

    RISING = 0
    FALLING = 1


class Effect(Names):
    """enum swb_effect"""

    JUMP = 0
    NOTE = 1
    STOP = 2


class Trigger(Names):
    """enum swb_trigger"""

    LEVEL = 0
    EDGE = 1


class ImpactLaw(Names):
    """enum swb_impact_law"""

    NEWTON = 0
    SEQUENTIAL = 1


class ImpactKind(Names):
    """enum swb_impact_kind"""

    COLLISION = 0
    PAINLEVE = 1
    LAST = 2


class ContactMode(Names):
    """enum swb_contact_mode"""

    OPEN = 0
    CLOSED = 1
    SLIDES = 2
    SLIDES_BACK = 3


class ProgressKind(Names):
    """enum swb_progress_kind"""

    STEPPED = 0
    SWITCHED = 1
    DONE = 2
    STOP_TIME = 3


class NmpcScheme(Names):
    """enum swb_nmpc_scheme"""

    RTI = 0
    MLI = 1
    AS_RTI = 2
    ASC = 3


class NmpcLevel(Names):
    """enum swb_nmpc_level"""

    A = 0
    B = 1
    C = 2
    D0 = 3
    D1 = 4
    D2 = 5


class NmpcQp(Names):
    """enum swb_nmpc_qp"""

    CONDENSING = 0
    STAGEWISE = 1
    AUTO = 2


class CReal(Names):
    """enum swb_c_real"""

    DOUBLE = 0
    FLOAT = 1


class NmpcSource(Names):
    """enum swb_nmpc_source"""

    QP = 0
    SOFT_QP = 1
    TANGENT = 2
    PLAN = 3
    HOLD = 4


class NmpcQpStatus(Names):
    """enum swb_nmpc_qp_status"""

    SOLVED = 0
    INFEASIBLE = 1
    OUT_OF_TIME = 2
    FAILED = 3


class PathAt(Names):
    """enum swb_path_at"""

    CONTROL_GRID = 0
    ELEMENTS = 1
    STAGE_POINTS = 2


class MultipliersOf(Names):
    """enum swb_multipliers_of"""

    COSTATES = 0
    INITIAL_STATE = 1
    STATES = 2
    CONTROLS = 3
    PARAMS = 4
    PATH = 5
    TERMINAL = 6
    BOUNDARY = 7
    RELAXED = 8


class Verdict(Names):
    """enum swb_verdict"""

    UNKNOWN = 0
    LOCAL_OPTIMUM = 1
    KINK = 2
    NOT_OPTIMAL = 3
    GLOBAL = 4


class Jumps(Names):
    """enum swb_jumps"""

    AUTO = 0
    MODES = 1
    FESD_J = 2
    STEPS = 3
    SHOTS = 4
    FREEZING = 5


class FreeTime(Names):
    """enum swb_free_time"""

    NONE = 0
    HORIZON = 1
    STAGES = 2


class CostAt(Names):
    """enum swb_cost_at"""

    RUNNING = 0
    CONTROL_GRID = 1
    TERMINAL = 2


class Norm(Names):
    """enum swb_norm"""

    L1 = 0
    L2 = 1
    LINF = 2


class Member(Names):
    """enum swb_member"""

    VARIABLE = 0
    CONSTRAINT = 1


class Sides(Names):
    """enum swb_sides"""

    BOTH = 0
    RISING = 1
    FALLING = 2
    NEITHER = 3


class Item(Names):
    """enum swb_item"""

    VARIABLE = 0
    CONSTRAINT = 1
    PAIR = 2
    BOX = 3


class Stationarity(Names):
    """enum swb_stationarity"""

    S = 0
    M = 1
    C = 2
    A = 3
    W = 4
    NONE = 5
    UNKNOWN = 6


class BStationarity(Names):
    """enum swb_b_stationarity"""

    YES = 0
    NO = 1
    UNDECIDED = 2


class Doubt(Names):
    """enum swb_doubt"""

    NONE = 0
    DATA = 1
    INFEASIBLE = 2
    NODES = 3
    ACCURACY = 4
    STOPPED = 5


class SecondOrder(Names):
    """enum swb_second_order"""

    STRICT_MINIMUM = 0
    SADDLE = 1
    UNDECIDED = 2
    UNKNOWN = 3


swb_log_fn = CFUNCTYPE(None, c_int64, c_char_p, c_void_p)
swb_iteration_fn = CFUNCTYPE(c_int32, c_void_p, c_void_p)
swb_value_fn = CFUNCTYPE(c_int32, c_void_p, c_void_p, c_void_p)
swb_jacobian_fn = CFUNCTYPE(c_int32, c_void_p, c_void_p, c_void_p)
swb_hessian_fn = CFUNCTYPE(c_int32, c_void_p, c_void_p, c_void_p, c_void_p)
swb_destroy_fn = CFUNCTYPE(None, c_void_p)
swb_code = CFUNCTYPE(None)
swb_progress_fn = CFUNCTYPE(c_int32, c_void_p, c_void_p)
swb_poll_fn = CFUNCTYPE(c_int32, c_void_p)
swb_decide_fn = CFUNCTYPE(c_int64, c_void_p, c_void_p)
swb_lagrangian_fn = CFUNCTYPE(c_int32, c_void_p, c_double, c_void_p, c_void_p, c_void_p)


class swb_settings(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("rk_family", c_int64),
        ("n_s", c_int64),
        ("n_fe", c_int64),
        ("discretisation", c_int64),
        ("stage_form", c_int64),
        ("cross", c_int64),
        ("step_equilibration", c_int64),
        ("rho_h", c_double),
        ("gamma_h", c_double),
        ("tol", c_double),
        ("max_iter", c_int64),
        ("max_time", c_double),
        ("mu_init", c_double),
        ("sigma_init", c_double),
        ("sigma_min", c_double),
        ("sigma_factor", c_double),
        ("sigma_exponent", c_double),
        ("mu_over_sigma", c_double),
        ("plateau_mu", c_double),
        ("plateau_viol", c_double),
        ("polish", c_int64),
        ("polish_tol", c_double),
        ("initial_guess", c_int64),
        ("log_level", c_int64),
        ("linear_solver", c_int64),
        ("ordering", c_int64),
        ("scaling", c_int64),
        ("centre_pairs", c_int64),
        ("convexify_pairs", c_int64),
        ("early_polish", c_int64),
        ("square_newton", c_int64),
        ("certify", c_int64),
        ("sigma_retries", c_int64),
        ("max_soc", c_int64),
        ("restore_tiny", c_int64),
        ("relaxation", c_int64),
        ("homotopy", c_int64),
        ("penalty_init", c_double),
        ("accuracy", c_int64),
        ("accuracy_tol", c_double),
        ("mode_search", c_int64),
        ("dcs_form", c_int64),
        ("lift_depth", c_int64),
        ("integration", c_int64),
        ("rtol", c_double),
        ("atol", c_double),
        ("h_init", c_double),
        ("h_max", c_double),
        ("max_steps", c_int64),
        ("max_switches", c_int64),
        ("zeno", c_int64),
        ("ambiguity", c_int64),
        ("dense", c_int64),
        ("sensitivity", c_int64),
        ("adjoint", c_int64),
        ("explain", c_int64),
        ("adapt_tol", c_double),
        ("adapt_rounds", c_int64),
        ("adapt_elements", c_int64),
        ("max_memory", c_int64),
        ("ocp_start", c_int64),
        ("portfolio", c_int64),
        ("selection", c_int64),
        ("search_effort", c_double),
        ("search_gain", c_double),
        ("search_samples", c_int64),
        ("search_seed", c_int64),
        ("search_exact", c_double),
        ("dense_steps", c_int64),
        ("branch_work", c_double),
    ]


class swb_residuals(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("primal", c_double),
        ("dual", c_double),
        ("complementarity", c_double),
        ("pair_product", c_double),
        ("pair_min", c_double),
    ]


class swb_stats(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("iterations", c_int64),
        ("factorisations", c_int64),
        ("evaluations", c_int64),
        ("restoration_iterations", c_int64),
        ("polish_iterations", c_int64),
        ("max_delta_w", c_double),
        ("time_eval", c_double),
        ("time_linalg", c_double),
        ("time_total", c_double),
        ("time_build", c_double),
        ("n_variables", c_int64),
        ("n_constraints", c_int64),
        ("n_pairs", c_int64),
        ("n_steps", c_int64),
        ("n_homotopies", c_int64),
        ("moved_bounds", c_int64),
    ]


class swb_linear_stats(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("n", c_int64),
        ("nnz_k", c_int64),
        ("nnz_l", c_int64),
        ("flops", c_double),
        ("min_abs_pivot", c_double),
        ("max_abs_pivot", c_double),
        ("shift", c_double),
        ("factorisations", c_int64),
        ("solves", c_int64),
        ("refinement_steps", c_int64),
        ("equilibrations", c_int64),
    ]


class swb_iteration_info(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("iter", c_int64),
        ("objective", c_double),
        ("inf_pr", c_double),
        ("inf_du", c_double),
        ("mu", c_double),
        ("sigma", c_double),
        ("inf_cc", c_double),
        ("step", c_double),
        ("delta_w", c_double),
        ("alpha_du", c_double),
        ("alpha_pr", c_double),
        ("trials", c_int64),
        ("phase", c_int64),
        ("incumbent", c_double),
    ]


class swb_freeze_options(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("step", c_double),
        ("speed", c_double),
        ("a_n", c_double),
        ("stiffness", c_double),
        ("creep", c_double),
        ("speed_of_time", c_int64),
    ]


class swb_freeze_layout(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("first_depth", c_int64),
        ("n_depths", c_int64),
        ("clock", c_int64),
        ("first_cost", c_int64),
        ("n_costs", c_int64),
        ("speed", c_int64),
    ]


class swb_point(Structure):
    _fields_ = [
        ("t", c_double),
        ("x", c_void_p),
        ("u", c_void_p),
        ("p", c_void_p),
    ]


class swb_casadi(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("eval", swb_code),
        ("n_in", swb_code),
        ("n_out", swb_code),
        ("name_in", swb_code),
        ("sparsity_in", swb_code),
        ("sparsity_out", swb_code),
        ("work", swb_code),
        ("checkout", swb_code),
        ("release", swb_code),
        ("incref", swb_code),
        ("decref", swb_code),
        ("int_size", swb_code),
        ("real_size", swb_code),
    ]


class swb_trajectory_info(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("nx", c_int64),
        ("n_elements", c_int64),
        ("n_s", c_int64),
        ("n_subsystems", c_int64),
        ("n_modes", c_int64),
        ("n_switches", c_int64),
        ("t_start", c_double),
        ("t_end", c_double),
    ]


class swb_switch(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("element", c_int64),
        ("subsystem", c_int64),
        ("kind", c_int64),
        ("before", c_uint64),
        ("after", c_uint64),
    ]


class swb_event(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("kind", c_int64),
        ("subsystem", c_int64),
        ("before", c_uint64),
        ("after", c_uint64),
        ("simultaneous", c_int64),
        ("unique", c_int64),
        ("rate", c_double),
        ("transversality", c_double),
    ]


class swb_run_stats(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("steps", c_int64),
        ("rejections", c_int64),
        ("relocations", c_int64),
        ("evaluations", c_int64),
        ("jacobians", c_int64),
        ("newton", c_int64),
        ("factorisations", c_int64),
        ("switches", c_int64),
        ("accumulations", c_int64),
        ("time_total", c_double),
        ("jumps", c_int64),
        ("impacts", c_int64),
        ("notes", c_int64),
    ]


class swb_run_info(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("nx", c_int64),
        ("outcome", c_int64),
        ("t_start", c_double),
        ("t_end", c_double),
        ("n_events", c_int64),
        ("n_subsystems", c_int64),
        ("n_pieces", c_int64),
        ("n_columns", c_int64),
        ("one_sided", c_int64),
        ("n_branch_points", c_int64),
        ("n_contacts", c_int64),
        ("n_accumulations", c_int64),
        ("n_jumps", c_int64),
        ("n_impacts", c_int64),
        ("n_scene_contacts", c_int64),
        ("redundant", c_int64),
        ("n_notes", c_int64),
        ("stopped_by", c_int64),
    ]


class swb_branch_point(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("n_continuations", c_int64),
        ("taken", c_int64),
    ]


class swb_contact(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("subsystem", c_int64),
        ("rate", c_double),
        ("transversality", c_double),
    ]


class swb_accumulation(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("until", c_double),
        ("steps", c_int64),
        ("error", c_double),
    ]


class swb_note(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("transition", c_int64),
        ("rate", c_double),
    ]


class swb_jump(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("transition", c_int64),
        ("simultaneous", c_int64),
        ("rate", c_double),
    ]


class swb_impact(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("contact", c_int64),
        ("kind", c_int64),
        ("simultaneous", c_int64),
        ("unique", c_int64),
        ("rate_before", c_double),
        ("rate_after", c_double),
        ("normal", c_double),
        ("tangential", c_double),
        ("tangential2", c_double),
        ("depth", c_double),
    ]


class swb_progress(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("x", c_void_p),
        ("nx", c_int64),
        ("kind", c_int64),
        ("steps", c_int64),
        ("switches", c_int64),
    ]


class swb_branching(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("x", c_void_p),
        ("nx", c_int64),
        ("n_continuations", c_int64),
        ("n_modes", c_int64),
        ("before", c_void_p),
        ("active", c_void_p),
        ("velocity", c_void_p),
    ]


class swb_step_options(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("h", c_double),
        ("theta", c_double),
        ("tolerance", c_double),
        ("max_iterations", c_int64),
        ("law", c_int64),
        ("correct", c_int64),
        ("look_at_all", c_int64),
    ]


class swb_step_stats(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("steps", c_int64),
        ("gaps", c_int64),
        ("bounds", c_int64),
        ("contacts", c_int64),
        ("most_contacts", c_int64),
        ("sweeps", c_int64),
        ("gradients", c_int64),
        ("unconverged", c_int64),
        ("worst_change", c_double),
        ("penetration", c_double),
        ("deepest", c_int64),
    ]


class swb_mhe_options(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("iterations", c_int64),
        ("rk_family", c_int64),
        ("n_s", c_int64),
        ("steps", c_int64),
        ("tol", c_double),
        ("deadline", c_double),
    ]


class swb_nmpc_options(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("scheme", c_int64),
        ("level", c_int64),
        ("inner", c_int64),
        ("qp_solver", c_int64),
        ("shift", c_int64),
        ("rk_family", c_int64),
        ("n_s", c_int64),
        ("steps", c_int64),
        ("tol", c_double),
        ("deadline", c_double),
        ("elastic_price", c_double),
        ("flips", c_int64),
        ("hysteresis", c_double),
        ("max_changes", c_int64),
    ]


class swb_nmpc_info(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("ready", c_int64),
        ("inner", c_int64),
        ("source", c_int64),
        ("qp_status", c_int64),
        ("qp_iterations", c_int64),
        ("time", c_double),
    ]


class swb_nmpc_monitor(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("kappa", c_double),
        ("omega", c_double),
        ("step", c_double),
        ("prediction", c_double),
        ("preparations", c_int64),
        ("preparation_last", c_double),
        ("preparation_total", c_double),
        ("preparation_worst", c_double),
        ("feedbacks", c_int64),
        ("feedback_last", c_double),
        ("feedback_total", c_double),
        ("feedback_worst", c_double),
        ("values", c_int64),
        ("jacobians", c_int64),
        ("adjoints", c_int64),
        ("hessians", c_int64),
        ("last_values", c_int64),
        ("last_jacobians", c_int64),
        ("last_adjoints", c_int64),
        ("last_hessians", c_int64),
        ("qps", c_int64),
        ("qp_iterations", c_int64),
        ("failed_linearisations", c_int64),
        ("from_qp", c_int64),
        ("from_soft_qp", c_int64),
        ("from_tangent", c_int64),
        ("from_plan", c_int64),
        ("from_hold", c_int64),
        ("alternatives", c_int64),
        ("flips", c_int64),
    ]


class swb_accuracy(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("reached", c_int64),
        ("n_switches", c_int64),
        ("worst", c_double),
        ("terminal", c_double),
        ("terminal_violation", c_double),
        ("cost", c_double),
        ("cost_error", c_double),
        ("along_violation", c_double),
        ("along_time", c_double),
        ("along_constraint", c_int64),
        ("along_row", c_int64),
    ]


class swb_optimality(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("verdict", c_int64),
        ("n_kinks", c_int64),
        ("residual", c_double),
        ("gap", c_double),
    ]


class swb_kink(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("stage", c_int64),
        ("t", c_double),
        ("before", c_double),
        ("after", c_double),
        ("touch", c_int64),
    ]


class swb_ocp_jump(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("t", c_double),
        ("transition", c_int64),
        ("stage", c_int64),
        ("at_once", c_int64),
    ]


class swb_multiphase_info(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("outcome", c_int64),
        ("polished", c_int64),
        ("n_phases", c_int64),
        ("cost", c_double),
        ("link_violation", c_double),
        ("error", c_double),
        ("iterations", c_int64),
        ("time_total", c_double),
    ]


class swb_certificate(Structure):
    _fields_ = [
        ("struct_size", c_uint64),
        ("stationarity", c_int64),
        ("sharp", c_int64),
        ("b_stationarity", c_int64),
        ("doubt", c_int64),
        ("biactive", c_int64),
        ("min_multiplier", c_double),
        ("strict", c_int64),
        ("lps", c_int64),
        ("lp_iterations", c_int64),
        ("nodes", c_int64),
        ("second_order", c_int64),
        ("dependent", c_int64),
        ("bound", c_double),
    ]


# name: (result, arguments)
FUNCTIONS = {
    "swb_last_error": (c_char_p, []),
    "swb_last_user_code": (c_int32, []),
    "swb_last_error_copy": (c_int32, [c_void_p, c_int64, c_void_p]),
    "swb_live_objects": (c_int64, []),
    "swb_error_handled": (None, []),
    "swb_status_string": (c_char_p, [c_int32]),
    "swb_status_name": (c_char_p, [c_int32]),
    "swb_version": (c_char_p, []),
    "swb_abi_version": (c_int32, []),
    "swb_check_version": (c_int32, [c_int32, c_int32]),
    "swb_settings_log": (c_int32, [POINTER(swb_settings), swb_log_fn, c_void_p]),
    "swb_settings_init": (c_int32, [POINTER(swb_settings), c_uint64]),
    "swb_settings_set_int": (c_int32, [POINTER(swb_settings), c_char_p, c_int64]),
    "swb_settings_set_double": (c_int32, [POINTER(swb_settings), c_char_p, c_double]),
    "swb_settings_set_string": (c_int32, [POINTER(swb_settings), c_char_p, c_char_p]),
    "swb_settings_get_int": (c_int32, [POINTER(swb_settings), c_char_p, c_void_p]),
    "swb_settings_get_double": (c_int32, [POINTER(swb_settings), c_char_p, c_void_p]),
    "swb_settings_get_string": (c_int32, [POINTER(swb_settings), c_char_p, c_void_p, c_int64, c_void_p]),
    "swb_settings_validate": (c_int32, [POINTER(swb_settings)]),
    "swb_settings_to_json": (c_int32, [POINTER(swb_settings), c_void_p, c_int64, c_void_p]),
    "swb_option_count": (c_int64, []),
    "swb_option_find": (c_int32, [c_char_p, c_void_p]),
    "swb_option_name": (c_char_p, [c_int64]),
    "swb_option_doc": (c_char_p, [c_int64]),
    "swb_option_symbol": (c_char_p, [c_int64]),
    "swb_option_value_name": (c_char_p, [c_int64, c_int64]),
    "swb_option_kind": (c_int32, [c_int64, c_void_p]),
    "swb_option_range": (c_int32, [c_int64, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_option_default": (c_int32, [c_int64, c_void_p]),
    "swb_option_setup_only": (c_int32, [c_int64, c_void_p]),
    "swb_outcome_name": (c_char_p, [c_int32]),
    "swb_freeze_options_init": (c_int32, [POINTER(swb_freeze_options), c_uint64]),
    "swb_scene_freeze": (c_int32, [c_void_p, c_void_p, POINTER(swb_freeze_options), c_void_p, c_int64, c_void_p, c_int64, POINTER(swb_freeze_layout), c_uint64, c_void_p]),
    "swb_scene_freeze_report": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_function_create": (c_int32, [c_char_p, c_int64, c_int64, c_int64, c_int64, swb_value_fn, c_void_p, swb_destroy_fn, c_void_p]),
    "swb_function_set_jacobian": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, swb_jacobian_fn]),
    "swb_function_set_hessian": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, swb_hessian_fn]),
    "swb_function_set_linear": (c_int32, [c_void_p]),
    "swb_function_set_inputs": (c_int32, [c_void_p, c_int32]),
    "swb_function_set_flags": (c_int32, [c_void_p, c_int32]),
    "swb_function_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_function_name": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_function_jacobian_pattern": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_function_hessian_pattern": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_function_eval": (c_int32, [c_void_p, POINTER(swb_point), c_void_p, c_int64]),
    "swb_function_eval_jacobian": (c_int32, [c_void_p, POINTER(swb_point), c_void_p, c_int64]),
    "swb_function_eval_hessian": (c_int32, [c_void_p, POINTER(swb_point), c_void_p, c_int64, c_void_p, c_int64]),
    "swb_function_check_derivatives": (c_int32, [c_void_p, POINTER(swb_point), c_void_p, c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_function_free": (None, [c_void_p]),
    "swb_function_from_casadi_library": (c_int32, [c_char_p, c_char_p, c_char_p, c_int64, c_int64, c_int64, c_void_p]),
    "swb_function_from_casadi_pointers": (c_int32, [c_char_p, POINTER(swb_casadi), POINTER(swb_casadi), POINTER(swb_casadi), c_char_p, c_int64, c_int64, c_int64, c_void_p]),
    "swb_function_from_casadi_file": (c_int32, [c_char_p, c_char_p, c_char_p, c_char_p, c_int64, c_int64, c_int64, c_void_p]),
    "swb_system_create": (c_int32, [c_int64, c_int64, c_int64, c_void_p]),
    "swb_system_set_f0": (c_int32, [c_void_p, c_void_p]),
    "swb_system_add_subsystem": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_system_add_subsystem_indicators": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p]),
    "swb_system_add_inclusion": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_void_p]),
    "swb_system_set_algebraic": (c_int32, [c_void_p, c_int64, c_void_p]),
    "swb_system_add_complementarity": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_void_p]),
    "swb_system_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_system_surfaces": (c_int32, [c_void_p, c_int64, POINTER(swb_point), c_void_p, c_int64, c_void_p]),
    "swb_system_free": (None, [c_void_p]),
    "swb_expr_create": (c_int32, [c_void_p]),
    "swb_expr_constants": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_expr_inputs": (c_int32, [c_void_p, c_int32, c_int64, c_void_p, c_int64]),
    "swb_expr_apply": (c_int32, [c_void_p, c_int32, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_expr_matmul": (c_int32, [c_void_p, c_int64, c_int64, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_expr_solve": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_int64]),
    "swb_expr_unknowns": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_expr_implicit": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_expr_inner_minimum": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_expr_signed_distance": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_double, c_void_p, c_void_p, c_int64]),
    "swb_expr_lagrangian_forces": (c_int32, [c_void_p, c_void_p, c_int64, c_int64, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_expr_table": (c_int32, [c_void_p, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p, c_int64]),
    "swb_expr_call": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_expr_jacobian": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_expr_text": (c_int32, [c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_expr_function": (c_int32, [c_void_p, c_char_p, c_int64, c_int64, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_expr_free": (None, [c_void_p]),
    "swb_model_create": (c_int32, [c_void_p, c_char_p, c_int64, c_int64, c_int64, c_void_p, c_char_p, POINTER(swb_point), c_void_p]),
    "swb_model_system": (c_int32, [c_void_p, c_void_p]),
    "swb_model_counts": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_model_report": (c_int32, [c_void_p, c_int32, c_void_p, c_int64, c_void_p]),
    "swb_model_write_c": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_model_write_fmu": (c_int32, [c_void_p, c_char_p, c_char_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_double, c_double, c_double]),
    "swb_model_free": (None, [c_void_p]),
    "swb_system_add_choice": (c_int32, [c_void_p, c_int64, c_void_p, c_int64, c_double, c_void_p]),
    "swb_model_add_choice": (c_int32, [c_void_p, c_int64, c_void_p, c_int64, c_double, c_void_p]),
    "swb_trajectory_get_info": (c_int32, [c_void_p, POINTER(swb_trajectory_info), c_uint64]),
    "swb_trajectory_times": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_states": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_steps": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_control_stages": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_modes": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_active": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_stage_times": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_stage_states": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_stage_theta": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_trajectory_switches": (c_int32, [c_void_p, POINTER(swb_switch), c_int64, c_uint64]),
    "swb_trajectory_state_at": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_trajectory_free": (None, [c_void_p]),
    "swb_simulator_create": (c_int32, [c_void_p, POINTER(swb_settings), c_void_p]),
    "swb_simulator_set_state": (c_int32, [c_void_p, c_double, c_void_p, c_int64]),
    "swb_simulator_set_controls": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_simulator_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_simulator_run": (c_int32, [c_void_p, c_double, c_int64, c_void_p]),
    "swb_simulator_step": (c_int32, [c_void_p, c_double, c_void_p]),
    "swb_simulator_clear": (c_int32, [c_void_p]),
    "swb_simulator_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_simulator_get_time": (c_int32, [c_void_p, c_void_p]),
    "swb_simulator_get_state": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_simulator_get_outcome": (c_int32, [c_void_p, c_void_p]),
    "swb_simulator_get_residuals": (c_int32, [c_void_p, POINTER(swb_residuals), c_uint64]),
    "swb_simulator_get_stats": (c_int32, [c_void_p, POINTER(swb_stats), c_uint64]),
    "swb_simulator_get_trajectory": (c_int32, [c_void_p, c_void_p]),
    "swb_simulator_set_int": (c_int32, [c_void_p, c_char_p, c_int64]),
    "swb_simulator_set_double": (c_int32, [c_void_p, c_char_p, c_double]),
    "swb_simulator_set_string": (c_int32, [c_void_p, c_char_p, c_char_p]),
    "swb_simulator_set_settings": (c_int32, [c_void_p, POINTER(swb_settings)]),
    "swb_simulator_get_settings": (c_int32, [c_void_p, POINTER(swb_settings), c_uint64]),
    "swb_simulator_set_iteration": (c_int32, [c_void_p, swb_iteration_fn, c_void_p]),
    "swb_simulator_set_log": (c_int32, [c_void_p, swb_log_fn, c_void_p]),
    "swb_simulator_interrupt": (c_int32, [c_void_p]),
    "swb_simulator_free": (None, [c_void_p]),
    "swb_run_outcome_name": (c_char_p, [c_int32]),
    "swb_run_get_info": (c_int32, [c_void_p, POINTER(swb_run_info), c_uint64]),
    "swb_run_reason": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_run_get_stats": (c_int32, [c_void_p, POINTER(swb_run_stats), c_uint64]),
    "swb_run_state": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_run_events": (c_int32, [c_void_p, POINTER(swb_event), c_int64, c_uint64]),
    "swb_run_branch_points": (c_int32, [c_void_p, POINTER(swb_branch_point), c_int64, c_uint64]),
    "swb_run_contacts": (c_int32, [c_void_p, POINTER(swb_contact), c_int64, c_uint64]),
    "swb_run_accumulations": (c_int32, [c_void_p, POINTER(swb_accumulation), c_int64, c_uint64]),
    "swb_run_modes": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_run_event_modes": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_int64]),
    "swb_run_sensitivity": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_run_event_sensitivity": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_times": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_run_evaluate": (c_int32, [c_void_p, c_void_p, c_int64, c_int64, c_void_p, c_int64]),
    "swb_run_free": (None, [c_void_p]),
    "swb_system_add_transition": (c_int32, [c_void_p, c_void_p, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_system_add_event": (c_int32, [c_void_p, c_char_p, c_int32, c_int32, c_void_p, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_system_add_known_times": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_notes": (c_int32, [c_void_p, POINTER(swb_note), c_int64, c_uint64]),
    "swb_run_note_state": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_note_sensitivity": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_jumps": (c_int32, [c_void_p, POINTER(swb_jump), c_int64, c_uint64]),
    "swb_run_jump_states": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_int64]),
    "swb_run_jump_sensitivity": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_scene_create": (c_int32, [c_char_p, c_int64, c_int64, c_int64, c_int64, c_char_p, c_void_p]),
    "swb_scene_create_with_states": (c_int32, [c_char_p, c_int64, c_int64, c_int64, c_int64, c_int64, c_char_p, c_void_p]),
    "swb_scene_create_projected": (c_int32, [c_char_p, c_int64, c_int64, c_int64, c_char_p, c_void_p]),
    "swb_scene_set_rates": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_scene_set_inertia": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_scene_set_force": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_scene_set_state_rates": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_scene_add_contact": (c_int32, [c_void_p, c_void_p, c_char_p, c_int64, c_void_p, c_int64, c_int64, c_int64, c_void_p]),
    "swb_scene_set_stiction": (c_int32, [c_void_p, c_void_p, c_int64, c_int64]),
    "swb_scene_set_separation": (c_int32, [c_void_p, c_void_p, c_int64, c_int64]),
    "swb_scene_add_friction": (c_int32, [c_void_p, c_void_p, c_char_p, c_int64, c_int64, c_int64, c_void_p]),
    "swb_scene_add_constraint": (c_int32, [c_void_p, c_void_p, c_char_p, c_int64, c_void_p]),
    "swb_scene_set_bounds": (c_int32, [c_void_p, c_int64, c_double, c_double]),
    "swb_scene_set_impact_law": (c_int32, [c_void_p, c_int32]),
    "swb_scene_build": (c_int32, [c_void_p, c_void_p]),
    "swb_scene_system": (c_int32, [c_void_p, c_void_p]),
    "swb_scene_report": (c_int32, [c_void_p, c_int32, c_void_p, c_int64, c_void_p]),
    "swb_scene_free": (None, [c_void_p]),
    "swb_run_impacts": (c_int32, [c_void_p, POINTER(swb_impact), c_int64, c_uint64]),
    "swb_run_impact_sensitivity": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_contact_modes": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_run_contact_forces": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_scene_add_discrete": (c_int32, [c_void_p, c_char_p, c_double, c_void_p]),
    "swb_scene_add_event": (c_int32, [c_void_p, c_void_p, c_char_p, c_int32, c_int32, c_int64, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_scene_add_clock": (c_int32, [c_void_p, c_void_p, c_double, c_double, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_scene_add_times": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_scene_add_pwm": (c_int32, [c_void_p, c_void_p, c_int64, c_double, c_double, c_int64, c_int64, c_void_p]),
    "swb_model_set_discrete": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_model_set_value_names": (c_int32, [c_void_p, c_int64, c_char_p]),
    "swb_model_get_value_names": (c_int32, [c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_add_transition": (c_int32, [c_void_p, c_void_p, c_int64, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_add_event": (c_int32, [c_void_p, c_void_p, c_char_p, c_int32, c_int32, c_int64, c_int32, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_add_clock": (c_int32, [c_void_p, c_void_p, c_double, c_double, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_add_times": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_add_pwm": (c_int32, [c_void_p, c_void_p, c_int64, c_double, c_double, c_int64, c_int64, c_void_p]),
    "swb_model_get_rule": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_model_transition_counts": (c_int32, [c_void_p, c_void_p, c_void_p]),
    "swb_model_get_discrete": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_model_transition_sizes": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_void_p]),
    "swb_model_get_transition": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_create": (c_int32, [c_void_p, POINTER(swb_settings), c_void_p]),
    "swb_integrator_reinit": (c_int32, [c_void_p, c_double, c_void_p, c_int64]),
    "swb_integrator_set_controls": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_integrator_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_integrator_set_tolerances": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_set_stop_times": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_integrator_set_preferred": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_set_decider": (c_int32, [c_void_p, swb_decide_fn, c_void_p]),
    "swb_integrator_step": (c_int32, [c_void_p, c_double, c_void_p]),
    "swb_integrator_advance": (c_int32, [c_void_p, c_double, c_void_p]),
    "swb_integrator_sample": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_integrator_get_dky": (c_int32, [c_void_p, c_double, c_int64, c_void_p, c_int64]),
    "swb_integrator_get_time": (c_int32, [c_void_p, c_void_p]),
    "swb_integrator_get_state": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_integrator_get_derivative": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_integrator_get_active": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_get_outcome": (c_int32, [c_void_p, c_void_p]),
    "swb_integrator_get_reason": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_integrator_get_stats": (c_int32, [c_void_p, POINTER(swb_run_stats), c_uint64]),
    "swb_integrator_get_run": (c_int32, [c_void_p, c_void_p]),
    "swb_integrator_adjoint": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_adjoint_along": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_integrator_set_int": (c_int32, [c_void_p, c_char_p, c_int64]),
    "swb_integrator_set_double": (c_int32, [c_void_p, c_char_p, c_double]),
    "swb_integrator_set_string": (c_int32, [c_void_p, c_char_p, c_char_p]),
    "swb_integrator_set_settings": (c_int32, [c_void_p, POINTER(swb_settings)]),
    "swb_integrator_get_settings": (c_int32, [c_void_p, POINTER(swb_settings), c_uint64]),
    "swb_integrator_set_progress": (c_int32, [c_void_p, swb_progress_fn, c_void_p]),
    "swb_integrator_set_poll": (c_int32, [c_void_p, swb_poll_fn, c_void_p]),
    "swb_integrator_set_log": (c_int32, [c_void_p, swb_log_fn, c_void_p]),
    "swb_integrator_interrupt": (c_int32, [c_void_p]),
    "swb_integrator_free": (None, [c_void_p]),
    "swb_step_options_init": (c_int32, [POINTER(swb_step_options), c_uint64]),
    "swb_stepper_create": (c_int32, [c_void_p, POINTER(swb_step_options), c_void_p]),
    "swb_stepper_set_state": (c_int32, [c_void_p, c_double, c_void_p, c_int64]),
    "swb_stepper_set_controls": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_stepper_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_stepper_step": (c_int32, [c_void_p]),
    "swb_stepper_advance": (c_int32, [c_void_p, c_double]),
    "swb_stepper_count": (c_int32, [c_void_p, c_double, c_int64, c_void_p]),
    "swb_stepper_run": (c_int32, [c_void_p, c_double, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_stepper_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_stepper_get_time": (c_int32, [c_void_p, c_void_p]),
    "swb_stepper_get_state": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_stepper_get_impulses": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_stepper_get_stats": (c_int32, [c_void_p, POINTER(swb_step_stats), c_uint64]),
    "swb_stepper_interrupt": (c_int32, [c_void_p]),
    "swb_stepper_free": (None, [c_void_p]),
    "swb_batch_create": (c_int32, [c_void_p, POINTER(swb_settings), c_void_p]),
    "swb_batch_run": (c_int32, [c_void_p, c_double, c_double, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_int64]),
    "swb_batch_size": (c_int32, [c_void_p, c_void_p]),
    "swb_batch_states": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_batch_outcomes": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_batch_get_run": (c_int32, [c_void_p, c_int64, c_void_p]),
    "swb_batch_interrupt": (c_int32, [c_void_p]),
    "swb_batch_free": (None, [c_void_p]),
    "swb_mhe_options_init": (c_int32, [POINTER(swb_mhe_options), c_uint64]),
    "swb_mhe_create": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, POINTER(swb_mhe_options), c_void_p]),
    "swb_mhe_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_mhe_prepare": (c_int32, [c_void_p, c_void_p, c_int64, POINTER(swb_nmpc_info), c_uint64]),
    "swb_mhe_estimate": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, POINTER(swb_nmpc_info), c_uint64]),
    "swb_mhe_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mhe_reset": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mhe_write_c": (c_int32, [c_void_p, c_char_p, c_char_p, c_int64]),
    "swb_mhe_get_window": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_mhe_get_covariance": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mhe_interrupt": (c_int32, [c_void_p]),
    "swb_mhe_free": (None, [c_void_p]),
    "swb_nmpc_options_init": (c_int32, [POINTER(swb_nmpc_options), c_uint64]),
    "swb_nmpc_create": (c_int32, [c_void_p, POINTER(swb_nmpc_options), c_void_p]),
    "swb_nmpc_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_nmpc_initialise": (c_int32, [c_void_p, c_void_p, c_int64, c_int64, c_void_p]),
    "swb_nmpc_prepare": (c_int32, [c_void_p, c_void_p, c_int64, POINTER(swb_nmpc_info), c_uint64]),
    "swb_nmpc_prepare_async": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_nmpc_wait": (c_int32, [c_void_p, POINTER(swb_nmpc_info), c_uint64]),
    "swb_nmpc_feedback": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, POINTER(swb_nmpc_info), c_uint64]),
    "swb_nmpc_finish": (c_int32, [c_void_p]),
    "swb_nmpc_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_nmpc_set_references": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_nmpc_set_time": (c_int32, [c_void_p, c_double]),
    "swb_nmpc_set_weights": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_nmpc_set_control_bounds": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_nmpc_set_state_bounds": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_nmpc_get_objective": (c_int32, [c_void_p, c_void_p]),
    "swb_nmpc_get_gain": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_nmpc_count_rows": (c_int32, [c_void_p, c_void_p]),
    "swb_nmpc_get_multipliers": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_nmpc_set_deadline": (c_int32, [c_void_p, c_double]),
    "swb_nmpc_set_iterate": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_nmpc_write_c": (c_int32, [c_void_p, c_char_p, c_char_p, c_int64]),
    "swb_nmpc_reset": (c_int32, [c_void_p]),
    "swb_nmpc_get_plan": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_nmpc_get_monitor": (c_int32, [c_void_p, POINTER(swb_nmpc_monitor), c_uint64]),
    "swb_nmpc_interrupt": (c_int32, [c_void_p]),
    "swb_nmpc_free": (None, [c_void_p]),
    "swb_ocp_create": (c_int32, [c_void_p, c_double, c_int64, POINTER(swb_settings), c_void_p]),
    "swb_ocp_set_lagrange": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_set_mayer": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_add_path": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_int32]),
    "swb_ocp_add_terminal": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_state_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_initial_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_initial_state": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_control_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_nominal": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_initial_time": (c_int32, [c_void_p, c_double]),
    "swb_ocp_set_state_guess": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_control_guess": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_solve": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_get_outcome": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_get_polished": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_get_cost": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_get_cost_reached": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_get_controls": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_sensitivity": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_ocp_get_residuals": (c_int32, [c_void_p, POINTER(swb_residuals), c_uint64]),
    "swb_ocp_get_stats": (c_int32, [c_void_p, POINTER(swb_stats), c_uint64]),
    "swb_ocp_get_trajectory": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_set_int": (c_int32, [c_void_p, c_char_p, c_int64]),
    "swb_ocp_set_double": (c_int32, [c_void_p, c_char_p, c_double]),
    "swb_ocp_set_string": (c_int32, [c_void_p, c_char_p, c_char_p]),
    "swb_ocp_set_settings": (c_int32, [c_void_p, POINTER(swb_settings)]),
    "swb_ocp_get_settings": (c_int32, [c_void_p, POINTER(swb_settings), c_uint64]),
    "swb_ocp_set_iteration": (c_int32, [c_void_p, swb_iteration_fn, c_void_p]),
    "swb_ocp_set_log": (c_int32, [c_void_p, swb_log_fn, c_void_p]),
    "swb_ocp_interrupt": (c_int32, [c_void_p]),
    "swb_ocp_free": (None, [c_void_p]),
    "swb_ocp_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_ocp_get_accuracy": (c_int32, [c_void_p, POINTER(swb_accuracy), c_uint64]),
    "swb_ocp_get_certificate": (c_int32, [c_void_p, POINTER(swb_certificate), c_uint64]),
    "swb_ocp_get_mismatch": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_message": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_ocp_count_multipliers": (c_int32, [c_void_p, c_int32, c_void_p]),
    "swb_ocp_multiplier_sizes": (c_int32, [c_void_p, c_int32, c_int64, c_void_p, c_void_p]),
    "swb_ocp_get_multipliers": (c_int32, [c_void_p, c_int32, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_verdict_name": (c_char_p, [c_int32]),
    "swb_ocp_get_optimality": (c_int32, [c_void_p, POINTER(swb_optimality), c_uint64]),
    "swb_ocp_get_kink": (c_int32, [c_void_p, c_int64, POINTER(swb_kink), c_uint64]),
    "swb_ocp_get_reduced_gradient": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_descent": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_optimality_reason": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_ocp_create_scene": (c_int32, [c_void_p, c_double, c_int64, POINTER(swb_settings), c_void_p]),
    "swb_ocp_set_jumps": (c_int32, [c_void_p, c_int32]),
    "swb_ocp_get_contacts": (c_int32, [c_void_p, c_void_p, c_void_p]),
    "swb_ocp_impacts": (c_int32, [c_void_p, POINTER(swb_impact), c_int64, c_uint64]),
    "swb_ocp_contact_modes": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_contact_forces": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_freezing_report": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_ocp_mode_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_ocp_get_modes": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_modes": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_get_mode_transitions": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_mode_transitions": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_ocp_random_starts": (c_int32, [c_void_p, c_uint64, c_void_p, c_int64]),
    "swb_ocp_solve_starts": (c_int32, [c_void_p, c_void_p, c_int64, c_int64, c_void_p]),
    "swb_ocp_get_start": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_adaptation": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_ocp_get_round": (c_int32, [c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_ocp_add_boundary": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_add_periodic": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_add_least_squares": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_int32]),
    "swb_ocp_set_references": (c_int32, [c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_add_relaxed": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_int32, c_int32, c_double]),
    "swb_ocp_add_complementarity": (c_int32, [c_void_p, c_void_p, c_void_p, c_int32]),
    "swb_ocp_set_elements": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_durations": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_free_time": (c_int32, [c_void_p, c_int32, c_double, c_double]),
    "swb_ocp_add_horizon": (c_int32, [c_void_p, c_double, c_double]),
    "swb_ocp_set_linear_controls": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_set_param_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_ocp_set_stage_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_solve_warm": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_shift": (c_int32, [c_void_p]),
    "swb_ocp_get_durations": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_control_ends": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_ocp_get_violation": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_jump_count": (c_int32, [c_void_p, c_void_p]),
    "swb_ocp_jumps": (c_int32, [c_void_p, POINTER(swb_ocp_jump), c_int64, c_uint64]),
    "swb_ocp_jump_states": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_int64]),
    "swb_multiphase_create": (c_int32, [c_void_p, c_int64, POINTER(swb_settings), c_void_p]),
    "swb_multiphase_link": (c_int32, [c_void_p, c_int64, c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_multiphase_link_continuous": (c_int32, [c_void_p, c_int64]),
    "swb_multiphase_link_reset": (c_int32, [c_void_p, c_int64, c_void_p]),
    "swb_multiphase_solve": (c_int32, [c_void_p, c_void_p]),
    "swb_multiphase_get_info": (c_int32, [c_void_p, POINTER(swb_multiphase_info), c_uint64]),
    "swb_multiphase_get_message": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_multiphase_get_phase": (c_int32, [c_void_p, c_int64, c_void_p]),
    "swb_multiphase_set_iteration": (c_int32, [c_void_p, swb_iteration_fn, c_void_p]),
    "swb_multiphase_interrupt": (c_int32, [c_void_p]),
    "swb_multiphase_free": (None, [c_void_p]),
    "swb_model_to_json": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_model_from_json": (c_int32, [c_void_p, c_char_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_scene_to_json": (c_int32, [c_void_p, c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_scene_from_json": (c_int32, [c_void_p, c_char_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_model_sizes": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p]),
    "swb_simulator_to_json": (c_int32, [c_void_p, c_double, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_simulator_from_json": (c_int32, [c_char_p, c_void_p, c_int64, c_void_p, c_void_p, c_void_p]),
    "swb_ocp_to_json": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_ocp_from_json": (c_int32, [c_char_p, c_void_p, c_int64, c_void_p]),
    "swb_mpcc_create": (c_int32, [c_int64, c_int64, c_void_p, c_void_p, POINTER(swb_settings), c_void_p]),
    "swb_mpcc_add_pair": (c_int32, [c_void_p, c_int32, c_int64, c_int32, c_int64]),
    "swb_mpcc_add_box": (c_int32, [c_void_p, c_int64, c_int64]),
    "swb_mpcc_set_hessian": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, swb_lagrangian_fn, c_void_p]),
    "swb_mpcc_set_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_mpcc_set_constraint_bounds": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_mpcc_set_params": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mpcc_set_start": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mpcc_set_warm_start": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_mpcc_solve": (c_int32, [c_void_p, c_void_p]),
    "swb_mpcc_resolve": (c_int32, [c_void_p, c_void_p]),
    "swb_mpcc_get_outcome": (c_int32, [c_void_p, c_void_p]),
    "swb_mpcc_get_polished": (c_int32, [c_void_p, c_void_p]),
    "swb_mpcc_get_objective": (c_int32, [c_void_p, c_void_p]),
    "swb_mpcc_get_solution": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mpcc_get_constraints": (c_int32, [c_void_p, c_void_p, c_int64]),
    "swb_mpcc_get_multipliers": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_mpcc_get_pairs": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_int64]),
    "swb_mpcc_get_residuals": (c_int32, [c_void_p, POINTER(swb_residuals), c_uint64]),
    "swb_mpcc_get_stats": (c_int32, [c_void_p, POINTER(swb_stats), c_uint64]),
    "swb_mpcc_set_int": (c_int32, [c_void_p, c_char_p, c_int64]),
    "swb_mpcc_set_double": (c_int32, [c_void_p, c_char_p, c_double]),
    "swb_mpcc_set_string": (c_int32, [c_void_p, c_char_p, c_char_p]),
    "swb_mpcc_set_settings": (c_int32, [c_void_p, POINTER(swb_settings)]),
    "swb_mpcc_get_settings": (c_int32, [c_void_p, POINTER(swb_settings), c_uint64]),
    "swb_mpcc_set_iteration": (c_int32, [c_void_p, swb_iteration_fn, c_void_p]),
    "swb_mpcc_set_log": (c_int32, [c_void_p, swb_log_fn, c_void_p]),
    "swb_mpcc_interrupt": (c_int32, [c_void_p]),
    "swb_mpcc_free": (None, [c_void_p]),
    "swb_mpcc_get_tangents": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_mpcc_vjp": (c_int32, [c_void_p, c_void_p, c_int64, c_double, c_void_p, c_int64, c_void_p, c_int64]),
    "swb_stationarity_name": (c_char_p, [c_int32]),
    "swb_doubt_name": (c_char_p, [c_int32]),
    "swb_second_order_name": (c_char_p, [c_int32]),
    "swb_mpcc_set_name": (c_int32, [c_void_p, c_int32, c_int64, c_char_p]),
    "swb_mpcc_set_names": (c_int32, [c_void_p, c_int32, c_void_p, c_int64]),
    "swb_mpcc_get_name": (c_int32, [c_void_p, c_int32, c_int64, c_void_p, c_int64, c_void_p]),
    "swb_mpcc_get_worst": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_mpcc_get_conflict": (c_int32, [c_void_p, c_void_p, c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_void_p]),
    "swb_mpcc_get_certificate": (c_int32, [c_void_p, POINTER(swb_certificate), c_uint64]),
    "swb_mpcc_get_scaled_residuals": (c_int32, [c_void_p, POINTER(swb_residuals), c_uint64]),
    "swb_mpcc_get_linear_stats": (c_int32, [c_void_p, POINTER(swb_linear_stats), c_uint64]),
    "swb_mpcc_statistics_json": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
    "swb_mpcc_report_text": (c_int32, [c_void_p, c_void_p, c_int64, c_void_p]),
}


def declare(library):
    """Give the functions of the loaded library their types."""
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library
