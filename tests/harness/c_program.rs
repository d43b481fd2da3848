//! C programs that are built against the library as a C programmer has it: header, libraries, pkg-config.

use std::{
    env, fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::Command,
};

use tempfile::TempDir;

use crate::programs::root;

/// A folder like `/usr`, with the library installed in it.
#[derive(Debug)]
pub struct Prefix(TempDir);

/// Which of the two libraries a program is linked to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Linkage {
    /// `libgridlight.so`, which is found when the program starts.
    Shared,
    /// `libgridlight.a`, which becomes a part of the program.
    Static,
}

impl Prefix {
    /// Installs the library that was built for the same profile as the running test.
    pub fn install() -> Self {
        let prefix = Self(tempfile::tempdir().expect("a temporary folder"));
        let (include, lib) = (prefix.0.path().join("include"), prefix.lib());
        fs::create_dir(&include).expect("a folder");
        fs::create_dir_all(lib.join("pkgconfig")).expect("a folder");
        let copy = |from: PathBuf, to: PathBuf| {
            fs::copy(&from, &to).unwrap_or_else(|error| {
                panic!(
                    "{}: {error}. Run `cargo test --workspace`, or first `cargo build -p capi`",
                    from.display()
                )
            });
        };
        copy(root().join("include/gridlight.h"), include.join("gridlight.h"));
        copy(built("libcapi.so"), lib.join("libgridlight.so.0"));
        copy(built("libcapi.a"), lib.join("libgridlight.a"));
        symlink("libgridlight.so.0", lib.join("libgridlight.so")).expect("a link");
        let template = fs::read_to_string(root().join("capi/gridlight.pc.in")).expect("the template");
        let pc = template
            .replace("@PREFIX@", &prefix.0.path().display().to_string())
            .replace("@LIBDIR@", &lib.display().to_string())
            .replace("@VERSION@", env!("CARGO_PKG_VERSION"));
        fs::write(lib.join("pkgconfig/gridlight.pc"), pc).expect("a file");
        prefix
    }

    /// Compiles a program with every warning an error.
    #[track_caller]
    pub fn compile(&self, source: &str, linkage: Linkage) -> PathBuf {
        let source = root().join(source);
        // A folder of its own: other tests may run the same program now.
        let folder = tempfile::tempdir_in(self.0.path())
            .expect("a temporary folder")
            .keep();
        let program = folder.join(source.file_stem().expect("a file has a name"));
        let flags = ["-std=c11", "-D_POSIX_C_SOURCE=200809L", "-O1", "-g"];
        let warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];
        let mut compiler = Command::new("cc");
        compiler.args(flags).args(warnings).arg(&source);
        compiler.arg("-o").arg(&program);
        match linkage {
            Linkage::Shared => compiler.args(self.pkg_config(&["--cflags", "--libs"])).arg("-lm"),
            Linkage::Static => {
                let embree = embree();
                let folder = embree.parent().expect("a file is in a folder");
                compiler
                    .args(self.pkg_config(&["--cflags"]))
                    .arg(self.lib().join("libgridlight.a"))
                    .arg(&embree)
                    .arg(format!("-Wl,-rpath,{}", folder.display()))
                    .args(["-lm", "-ldl"])
            }
        };
        let output = compiler.arg("-pthread").output().expect("there is a C compiler");
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{compiler:?}:\n{text}");
        program
    }

    /// A command that runs a program of [`Self::compile`].
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.env("LD_LIBRARY_PATH", self.lib()).current_dir(root());
        command
    }

    /// As [`Self::command`], under valgrind, which makes exit code 99 of every bad access and every leak.
    /// `None` if valgrind is not there.
    ///
    /// Threads that live until the process ends (Rayon's, TBB's) own memory then, so memory that
    /// something still points to is no leak.
    pub fn checked_command(&self, program: &Path) -> Option<Command> {
        let valgrind = Command::new("valgrind").arg("--version").output();
        valgrind.ok().filter(|output| output.status.success())?;
        let mut command = self.command("valgrind".as_ref());
        command
            .args(["--quiet", "--error-exitcode=99", "--leak-check=full"])
            .args([
                "--show-leak-kinds=definite,indirect",
                "--errors-for-leak-kinds=definite,indirect",
            ])
            .arg(program);
        Some(command)
    }

    /// A place for a file.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn lib(&self) -> PathBuf {
        self.0.path().join("lib")
    }

    fn pkg_config(&self, flags: &[&str]) -> Vec<String> {
        let output = Command::new("pkg-config")
            .args(flags)
            .arg("gridlight")
            .env("PKG_CONFIG_PATH", self.lib().join("pkgconfig"))
            .output()
            .expect("pkg-config runs: ./setup installs it");
        assert!(output.status.success(), "pkg-config finds gridlight.pc");
        let text = String::from_utf8(output.stdout).expect("flags are text");
        text.split_whitespace().map(str::to_owned).collect()
    }
}

/// A library beside the running test: target/<profile>/deps.
fn built(name: &str) -> PathBuf {
    let test = env::current_exe().expect("a running test has a path");
    test.with_file_name(name)
}

/// Embree's library, as the shared library of ours finds it.
fn embree() -> PathBuf {
    let output = Command::new("ldd")
        .arg(built("libcapi.so"))
        .output()
        .expect("ldd comes with the C library");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find(|line| line.contains("libembree4"));
    let path = line.and_then(|line| line.split_whitespace().find(|word| word.starts_with('/')));
    path.unwrap_or_else(|| panic!("our library does not use Embree:\n{text}"))
        .into()
}
