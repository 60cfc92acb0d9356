/* Calls one of LinuxCNC's kinematics modules outside any real-time system.

   Usage: kinematics_host MODULE.so [PIN=VALUE ...]
   A pin is named by what stands behind its last dot; switch=1 chooses the module's second kinematics.  Lines on stdin:
       i X Y Z A B C U V W     pose  -> joints (9 numbers)
       f J0 .. J8              joints -> pose  (9 numbers)
   Angles in degrees.  What the module asks of the hardware abstraction layer stands below: pins are plain numbers. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { double x, y, z, a, b, c, u, v, w; } Pose;

static int settings;
static char **setting;

static double set_value(const char *name)
{
    const char *last = strrchr(name, '.') ? strrchr(name, '.') + 1 : name;
    size_t length = strlen(last);
    for (int k = 0; k < settings; k++)
        if (!strncmp(setting[k], last, length) && setting[k][length] == '=') return atof(setting[k] + length + 1);
    return 0.0;
}

static int numbers;
static double *number[64];
static char *named[64];

static int number_pin(double **at, const char *name)
{
    *at = calloc(1, sizeof(double));
    number[numbers] = *at;
    named[numbers++] = strdup(name);
    return 0;
}

static void set_numbers(void)       /* once the module has set what it begins with */
{
    for (int k = 0; k < numbers; k++)
        for (int n = 0; n < settings; n++) {
            const char *last = strrchr(named[k], '.') ? strrchr(named[k], '.') + 1 : named[k];
            size_t length = strlen(last);
            if (!strncmp(setting[n], last, length) && setting[n][length] == '=') *number[k] = atof(setting[n] + length + 1);
        }
}

static int other_pin(void **at) { *at = calloc(1, 16); return 0; }

int hal_init(const char *name) { return 1; }
int hal_exit(int id) { return 0; }
int hal_ready(int id) { return 0; }
int hal_set_unready(int id) { return 0; }
void *hal_malloc(long size) { return calloc(1, size); }
int hal_pin_float_new(const char *name, int dir, double **at, int id) { return number_pin(at, name); }
int hal_pin_bit_new(const char *name, int dir, void **at, int id) { return other_pin(at); }
int hal_pin_s32_new(const char *name, int dir, void **at, int id) { return other_pin(at); }
int hal_pin_s32_newf(int dir, void **at, int id, const char *format, ...) { return other_pin(at); }
int hal_pin_float_newf(int dir, double **at, int id, const char *format, ...)
{
    char name[256];
    va_list rest;
    va_start(rest, format);
    vsnprintf(name, sizeof name, format, rest);
    va_end(rest);
    return number_pin(at, name);
}
void rtapi_print(const char *format, ...) {}
void rtapi_print_msg(int level, const char *format, ...) {}
int rtapi_snprintf(char *out, unsigned long size, const char *format, ...)
{
    va_list rest;
    va_start(rest, format);
    int n = vsnprintf(out, size, format, rest);
    va_end(rest);
    return n;
}

int main(int count, char **words)
{
    settings = count - 2;
    setting = words + 2;
    void *module = dlopen(words[1], RTLD_NOW | RTLD_GLOBAL);
    if (!module) { fprintf(stderr, "%s\n", dlerror()); return 1; }
    int (*begin)(void) = (int (*)(void))dlsym(module, "rtapi_app_main");
    int (*forward)(const double *, Pose *, const unsigned long *, unsigned long *) = dlsym(module, "kinematicsForward");
    int (*inverse)(const Pose *, double *, const unsigned long *, unsigned long *) = dlsym(module, "kinematicsInverse");
    int (*type)(void) = (int (*)(void))dlsym(module, "kinematicsType");    /* some modules set themselves up in it */
    if (!begin || !forward || !inverse || !type || begin() < 0 || type() < 0) { fprintf(stderr, "%s is no kinematics module\n", words[1]); return 1; }
    set_numbers();
    int (*to)(int) = (int (*)(int))dlsym(module, "kinematicsSwitch");
    if (to && set_value("switch") > 0.0) to((int)set_value("switch"));
    char what[2];
    double in[9], joints[16];
    unsigned long one = 0, two = 0;
    while (scanf("%1s", what) == 1) {
        for (int k = 0; k < 9; k++) if (scanf("%lf", in + k) != 1) return 1;
        Pose pose = {0};
        memset(joints, 0, sizeof joints);
        int failed;
        if (*what == 'i') { memcpy(&pose, in, sizeof pose); failed = inverse(&pose, joints, &one, &two); }
        else { memcpy(joints, in, sizeof in); failed = forward(joints, &pose, &one, &two); }
        if (failed) { fprintf(stderr, "the module refuses: %d\n", failed); return 1; }
        double *out = *what == 'i' ? joints : (double *)&pose;
        for (int k = 0; k < 9; k++) printf("%.17g%c", out[k], k < 8 ? ' ' : '\n');
    }
    return 0;
}
