// Bindings and results of the measuring kernels, read by GLSL and C++.
#define METRICS_GROUPS 64      // work-groups of a reduction at most; the number depends on the mesh alone
#define METRICS_SIZE 256       // invocations of a work-group

// Sums over one body, in this order in a row. Those from M_ANGULAR on need the centre and rotation of the others.
#define M_VOLUME_CHANGE 0      // sum V - V0, m^3
#define M_TET_SQUARES 1        // sum ((V - V0)/V0)^2
#define M_TET_MAX 2
#define M_INVERTED 3           // tets with V <= 0
#define M_STRETCH_SQUARES 4    // sum ((l - d)/d)^2
#define M_STRETCH_MAX 5
#define M_BEND_SQUARES 6       // sum of squared angle errors, rad^2
#define M_ELASTIC 7            // J, of a material or of constraints with compliance
#define M_ELASTIC_MIDWAY 8     // J, of positions half a substep before, where velocities are of mid-substep
#define M_MOMENT 9             // 3: sum m (x - x0), x0 the body's first vertex
#define M_MOMENTUM 12          // 3: sum m v
#define M_SPEED 15             // sum m |v|
#define M_KINETIC 16           // J
#define M_HEIGHT 17            // sum m y
#define M_COVARIANCE 18        // 9: sum m (x - x0) X^T, column by column
#define M_WORK 27              // J that obstacles that move have done
#define M_CONTACTS 28          // pairs of a vertex and an obstacle that it touches
#define M_NON_FINITE 29        // vertices with a position or velocity that is not finite
#define M_PENETRATION 30       // m, of the vertex that is deepest in an obstacle
#define M_DEPTHS 31            // DEPTHS: vertices by depth over the size, from 1 on in steps of half an octave
#define DEPTHS 32
#define M_ANGULAR 63           // 3: sum m r x u about the centre of mass
#define M_RIGID_SQUARES 66     // sum m |x - c - R X|^2
#define M_AVERAGED 67          // J, what averages of smoothed tets store; M_ELASTIC has the tets' own
#define M_AVERAGED_MIDWAY 68
#define M_CENTRE 69            // 3: c - x0
#define M_ROTATION 72          // 4: quaternion w, x, y, z
#define M_ORIGIN 76            // 3: x0
#define M_HELD 79              // J, of attachments and fibres, in the row of the first body
#define M_HELD_MIDWAY 80
#define M_ROW 81
#define M_STRIDE 128           // floats from one body's row to the next: a multiple of any driver's binding alignment
