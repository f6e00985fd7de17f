//! Generated C on an emulated Cortex-M4F and Cortex-M7: the bits of the host, and single precision without
//! doubles.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::{Config, Function, Language};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Programs without which this is skipped; `REQUIRE_QEMU` makes them a must.
const PROGRAMS: [&str; 3] = ["cc", "arm-none-eabi-gcc", "qemu-system-arm"];

fn missing() -> Option<&'static str> {
    let there =
        |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    let missing = PROGRAMS.into_iter().find(|program| !there(program))?;
    assert!(std::env::var_os("REQUIRE_QEMU").is_none(), "there is no {missing}");
    Some(missing)
}

/// Prints the bits of every result at some states.
const MAIN: &str = r#"
#include "arm.h"
#include <stdint.h>
#include <string.h>
typedef powerball_lwa4p_real real;
void put_char(char c);
static void put(const real *x, int n) {
    for (int i = 0; i < n; i++) {
        unsigned char bytes[sizeof *x];
        memcpy(bytes, x + i, sizeof bytes);
        for (unsigned k = 0; k < sizeof bytes; k++) {
            put_char("0123456789abcdef"[bytes[k] >> 4]);
            put_char("0123456789abcdef"[bytes[k] & 15]);
        }
        put_char('\n');
    }
}
int main(void) {
    real p[POWERBALL_LWA4P_PARAMETERS], q[6], dq[6], ddq[6];
    /* A generator of whole numbers, which are the same everywhere. */
    uint32_t random = 1;
    for (int i = 0; i < POWERBALL_LWA4P_PARAMETERS; i++) p[i] = (real)(i + 1) / (real)7;
    for (int sample = 0; sample < 40; sample++) {
        real size = (real)1;
        for (int k = 0; k < sample % 4; k++) size *= (real)20;
        for (int i = 0; i < 18; i++) {
            random = random * 1664525u + 1013904223u;
            real x = (real)(int32_t)(random >> 8) / (real)8388608 - (real)1;
            if (i < 6) q[i] = x * size; else if (i < 12) dq[i - 6] = x; else ddq[i - 12] = x;
        }
        real tau[6], b[6][6], y[6][POWERBALL_LWA4P_PARAMETERS], t[4][4];
        powerball_lwa4p_inverse_dynamics(q, dq, ddq, p, tau);
        put(tau, 6);
        powerball_lwa4p_forward_dynamics(q, dq, tau, p, tau);
        put(tau, 6);
        powerball_lwa4p_mass_matrix(q, p, b);
        put(&b[0][0], 36);
        powerball_lwa4p_regressor(q, dq, ddq, y);
        put(&y[0][0], 6 * POWERBALL_LWA4P_PARAMETERS);
        powerball_lwa4p_forward_kinematics(q, t);
        put(&t[0][0], 16);
        real energy = powerball_lwa4p_kinetic_energy(q, dq, p);
        put(&energy, 1);
    }
    return 0;
}
"#;

const HOST: &str = "#include <stdio.h>\nvoid put_char(char c);\nvoid put_char(char c) { putchar(c); }\n";

/// Where a board begins, and how it prints: by semihosting.
const BOARD: &str = r#"
int main(void);
void put_char(char c);
void reset(void);
static void ask(int operation, const void *with) {
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = with;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}
void put_char(char c) { ask(3, &c); }
void reset(void) {
    /* The coprocessors of floating point. */
    *(volatile unsigned *)0xE000ED88u |= 0xFu << 20;
    __asm__ volatile("dsb\nisb");
    main();
    ask(0x18, (void *)0x20026);
    for (;;) {}
}
__attribute__((section(".vectors"), used)) void *const vectors[2] = { (void *)0x20040000u, (void *)reset };
"#;

const MEMORY: &str = "
MEMORY { FLASH (rx) : ORIGIN = 0x00000000, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 128K }
SECTIONS {
    .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) } > FLASH
    .ARM.exidx : { *(.ARM.exidx*) } > FLASH
    .data : { *(.data*) } > RAM
    .bss : { *(.bss*) *(COMMON) end = .; } > RAM
}
";

fn run(program: &str, arguments: &[&str], folder: &Path) -> String {
    let out = Command::new(program).args(arguments).current_dir(folder).output().unwrap();
    assert!(out.status.success(), "{program} {arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).into_owned()
}

/// What a program prints on an emulated board. One that hangs is killed.
fn emulated(board: &str, core: &str, program: &Path) -> String {
    let mut child = Command::new("qemu-system-arm")
        .args(["-M", board, "-cpu", core, "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(program)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut printed = [child.stdout.take().map(read), child.stderr.take().map(read)];
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            panic!("the emulated board does not come to an end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let text = printed.iter_mut().filter_map(Option::take).map(|reader| reader.join().unwrap());
    text.collect()
}

/// Reads to the end, so that the writer does not wait.
fn read(mut from: impl std::io::Read + Send + 'static) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut text = String::new();
        from.read_to_string(&mut text).unwrap();
        text
    })
}

#[test]
fn a_controller_has_the_host_s_bits() {
    if let Some(missing) = missing() {
        eprintln!("skipped: there is no {missing} (apt-get install gcc gcc-arm-none-eabi qemu-system-arm)");
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("c_controller");
    std::fs::create_dir_all(&folder).unwrap();
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("../powerball/arm.toml");
    use Function::*;
    let functions =
        [InverseDynamics, ForwardDynamics, MassMatrix, Regressor, ForwardKinematics, KineticEnergy];
    let config = Config::new(arm).functions(functions).language(Language::C);
    config.write(&folder.join("arm.c")).unwrap();
    for (name, text) in [("main.c", MAIN), ("host.c", HOST), ("board.c", BOARD), ("memory.ld", MEMORY)] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let common = ["-std=gnu99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"];
    let (m4, m7) = (["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"], ["-mcpu=cortex-m7", "-mfpu=fpv5-d16"]);
    let (float, double) = ("-DPOWERBALL_LWA4P_FLOAT", "-DDOUBLE");
    for scalar in [float, double] {
        let files = ["arm.c", "main.c", "host.c", "-lm", "-o", "host"];
        run("cc", &[&common[..], &[scalar], &files].concat(), &folder);
        let expected = run(folder.join("host").to_str().unwrap(), &[], &folder);
        assert_eq!(expected.lines().count(), 40 * (6 + 6 + 36 + 6 * 19 + 16 + 1));
        for (board, core, flags) in [("mps2-an386", "cortex-m4", m4), ("mps2-an500", "cortex-m7", m7)] {
            let target = [&common[..], &["-mthumb", "-mfloat-abi=hard", scalar], &flags].concat();
            let files =
                ["arm.c", "main.c", "board.c", "-nostartfiles", "--specs=nosys.specs", "-T", "memory.ld"];
            run("arm-none-eabi-gcc", &[&target[..], &files, &["-lm", "-o", core]].concat(), &folder);
            assert!(emulated(board, core, &folder.join(core)) == expected, "{core} {scalar}");
            run("arm-none-eabi-gcc", &[&target[..], &["-c", "arm.c", "-o", "arm.o"]].concat(), &folder);
            let called = run("arm-none-eabi-nm", &["--undefined-only", "arm.o"], &folder);
            let soft = called.lines().any(|line| line.contains("__aeabi_d") || line.contains("2d"));
            assert_eq!(soft, scalar == double && core == "cortex-m4", "{core} {scalar}: {called}");
        }
    }
}
