"""The page that answers in the browser, used in Chromium: what it says is what the same command says here.

    python tests/try.py target/site/try target/release

`.ci/pages` calls this after `.ci/try` has built the page; the second folder has the programs `powerball` and `dyngen`.
"""

import base64
import functools
import http.server
import json
import math
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from playwright.sync_api import sync_playwright

SITE, PROGRAMS = (Path(argument).resolve() for argument in sys.argv[1:3])
SAMPLE = {"": ["arm.toml"], "fit": ["fit_1.csv", "fit_2.csv", "fit_3.csv"], "validate": ["held_out_1.csv"]}
#: A browser adds in another order than a processor with wider registers.
TOLERANCE = 1e-6
#: Seconds that an answer may take on a busy machine, ms.
PATIENCE = 100_000
URDF = Path(__file__).parent.parent / "dyngen/tests/urdf/puma.urdf"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def differences(a, b, place=""):
    """Where two JSON values differ."""
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        return [d for key in a for d in differences(a[key], b[key], f"{place}/{key}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [d for k, pair in enumerate(zip(a, b)) for d in differences(*pair, f"{place}/{k}")]
    numbers = all(isinstance(x, float) for x in (a, b))
    same = math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=1e-12) if numbers else a == b
    return [] if same else [f"{place}: {a} and {b}"]


def here(page, folder):
    """The command that the page shows, run here: exit code, words, and what it says on standard error."""
    words = shlex.split(page.locator("#command").text_content())
    done = subprocess.run([PROGRAMS / words[0], *words[1:]], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout.rstrip(), done.stderr.rstrip()


def answer(page):
    """Exit code, words and errors of the page once it has them."""
    page.locator("#meaning:not(:empty)").wait_for(timeout=PATIENCE)
    code = int(page.locator("#meaning").text_content().split("Exit code ")[1].split(",")[0])
    return code, page.locator("#words").text_content(), page.locator("#errors").text_content()


def downloaded(page, name):
    with page.expect_download() as download:
        page.locator("#downloads a", has_text=name).first.click()
    return Path(download.value.path()).read_bytes()


def ask(page, button, folder):
    """What the page answers, after the same was asked here."""
    page.get_by_role("button", name=button).click()
    said, expected = answer(page), here(page, folder)
    assert said == expected, f"{button}: the page says\n{said}\nand the command\n{expected}"
    return said


def sample(page, folder):
    """Takes the sample with one click, and the same files here."""
    for place, names in SAMPLE.items():
        (folder / place).mkdir(exist_ok=True)
        for name in names:
            packed = subprocess.run(["gzip", "-dc", SITE / f"sample/{name}.gz"], capture_output=True, check=True)
            (folder / place / name).write_bytes(packed.stdout)
    page.get_by_role("button", name="take the sample").click()
    page.locator("#validate-names", has_text="held_out_1.csv").wait_for()


def explains_the_sample_as_the_command_does(page, folder):
    sample(page, folder)
    code, words, _ = ask(page, "Explain", folder)
    assert code == 0 and "torque_constant on joint 2" in words, words
    ours, theirs = downloaded(page, "explained.json"), (folder / "explained/explained.json").read_bytes()
    wrong = differences(json.loads(ours), json.loads(theirs))
    assert not wrong, "\n".join(wrong[:5])
    report = page.frame_locator("#report")
    report.locator("figure").first.wait_for()
    page.get_by_role("button", name="Code of this model in Rust").click()
    page.locator("#downloads a", has_text="controller.rs").wait_for(timeout=PATIENCE)
    assert answer(page)[0] == 0
    assert b"impl TorqueModel" in downloaded(page, "controller.rs"), "the controller's code has no torque model"
    page.get_by_role("button", name="The rigid arm in C").click()
    page.locator("#downloads a", has_text="arm.c").wait_for(timeout=PATIENCE)
    (folder / "code").mkdir()
    assert answer(page)[:2] == here(page, folder)[:2]
    assert downloaded(page, "arm.c") == (folder / "code/arm.c").read_bytes(), "another arm.c than the command writes"


def identifies_and_compares_as_the_command_does(page, folder):
    sample(page, folder)
    ask(page, "Identify", folder)
    ours = json.loads(downloaded(page, "identified.json"))
    theirs = json.loads((folder / "identified/identified.json").read_bytes())
    wrong = differences([ours["fit"], ours["validate"]], [theirs["fit"], theirs["validate"]])
    assert not wrong, "\n".join(wrong[:5])
    ask(page, "Compare two logs", folder)
    ask(page, "What is in the logs?", folder)


def says_of_a_bad_file_what_the_command_says(page, folder):
    sample(page, folder)
    bad = folder / "fit/bad.csv"
    bad.write_text("t,q1,tau1\n0,1,2\n0.1,x,2\n")
    page.locator("#fit-file").set_input_files(bad)
    page.locator("#fit-names", has_text="bad.csv").wait_for()
    code, _, wrong = ask(page, "Identify", folder)
    assert code != 0 and "bad.csv" in wrong, wrong
    assert page.locator("#errors").is_visible(), "the reason is not shown"


def imports_a_urdf_that_is_dropped(page, folder):
    text = base64.b64encode(URDF.read_bytes()).decode()
    page.locator(".drop[data-for=arm]").evaluate(
        """(place, text) => {
            const data = new DataTransfer();
            data.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], "puma.urdf"));
            place.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
        }""",
        text,
    )
    said = answer(page)
    shutil.copy(URDF, folder)
    assert said == here(page, folder), said
    assert downloaded(page, "arm.toml") == (folder / "arm.toml").read_bytes(), "another arm file than the command writes"


def stops_and_goes_on(page, folder):
    sample(page, folder)
    page.get_by_role("button", name="Explain").click()
    page.get_by_role("button", name="Stop").click()
    page.locator("#words", has_text="stopped").wait_for()
    ask(page, "Identify", folder)


CHECKS = [
    explains_the_sample_as_the_command_does,
    identifies_and_compares_as_the_command_does,
    says_of_a_bad_file_what_the_command_says,
    imports_a_urdf_that_is_dropped,
    stops_and_goes_on,
]


def main():
    handler = functools.partial(Quiet, directory=SITE)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}/"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        for check in CHECKS:
            page = browser.new_page()
            wrong, requests = [], []
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
            page.goto(address + "index.html")
            page.locator("body[data-ready]").wait_for(timeout=PATIENCE)
            page.context.on("request", lambda request: requests.append(request.url))
            with tempfile.TemporaryDirectory() as folder:
                check(page, Path(folder))
            assert not wrong, wrong
            asked = [url for url in requests if not url.startswith((f"{address}sample/", "blob:", "data:"))]
            assert not asked, f"the page asks for {asked}"
            print(f"{check.__name__.replace('_', ' ')}: passed in {browser.version}")
            page.close()
        browser.close()


main()
