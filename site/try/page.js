// The page builds command lines and shows what the commands say and write. What is computed is computed by them.

/// What an exit code means: docs/exit_codes.md.
const MEANING = [
    ["good", "Done."],
    ["bad", "The data or the arm refused it."],
    ["bad", "Wrong use, or an input that cannot be read."],
    ["bad", "This result should not be used. Its reason is the first line."],
];
const SAMPLE = { arm: ["arm.toml"], fit: ["fit_1.csv", "fit_2.csv", "fit_3.csv"], validate: ["held_out_1.csv"] };
/// The folder of each question's results, and the file in it that code is generated of.
const RESULTS = { log: "seen", identify: "identified", explain: "explained", compare: "compared" };
const MODEL = { identify: "identified/identified.json", explain: "explained/model.json" };

const by = (id) => document.getElementById(id);
const given = { arm: [], fit: [], validate: [] };
let script, programs, worker, running, timer, model;

// What the page is made of: read once, so that nothing is asked of the network later.

async function fetched(name) {
    const answer = await fetch(name);
    if (!answer.ok) throw new Error(`${name}: the server answers ${answer.status}`);
    return answer;
}

/** The bytes of NAME.gz, unpacked. */
async function unpacked(name) {
    const bytes = new Uint8Array(await (await fetched(`${name}.gz`)).arrayBuffer());
    // Some servers have it unpacked on the way.
    if (bytes[0] !== 0x1f || bytes[1] !== 0x8b) return bytes;
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function load() {
    const texts = ["wasi.js", "worker.js"].map(async (name) => (await fetched(name)).text());
    const modules = ["powerball", "dyngen"].map(async (name) => [name, await WebAssembly.compile(await unpacked(`${name}.wasm`))]);
    script = URL.createObjectURL(new Blob(await Promise.all(texts), { type: "text/javascript" }));
    programs = new Map(await Promise.all(modules));
    start();
    by("state").textContent = "The programs are loaded.";
    document.body.dataset.ready = "yes";
}

// The worker.

function start() {
    worker = new Worker(script);
    worker.onmessage = ({ data }) => heard(data);
    worker.onerror = (e) => failed(e.message);
    worker.postMessage({ programs });
}

function heard(data) {
    if (data.said) running.said(data.said, data.text);
    if (data.ended !== undefined) running.end(data);
    if (data.failed) failed(data.failed);
}

/** Runs a command; gives its exit code, what it said and the files that are there then. */
function ran(program, words, show) {
    return new Promise((done) => {
        const text = { out: "", err: "" };
        running = {
            text,
            said(stream, more) {
                text[stream] += more;
                show?.(text);
            },
            end({ ended, seconds, files }) {
                running = undefined;
                done({ code: ended, seconds, files, ...text });
            },
        };
        worker.postMessage({ program, words });
    });
}

/** A program that stopped or could not be loaded: shown in red, and a new worker is started. */
function failed(why) {
    by("answer").hidden = false;
    by("progress").hidden = true;
    by("errors").textContent = `${running?.text.err ?? ""}\nThe program ended without an answer: ${why}. Large logs may need ` +
        "more memory than a tab has: give shorter logs, or install the command.";
    by("words").textContent = "";
    if (running) again();
}

/** Stops what runs: a new worker has the files that were given. */
function again() {
    worker.terminate();
    clearInterval(timer);
    running = undefined;
    idle(true);
    start();
    for (const kind of Object.keys(given)) given[kind].forEach((file) => put(file));
}

const put = ({ path, bytes }) => worker.postMessage({ put: path, bytes });

// What is given.

/** Files of a kind; those of the same kind before are gone. */
async function give(kind, files) {
    given[kind].forEach(({ path }) => worker.postMessage({ remove: path }));
    const folder = kind === "arm" ? "" : `${kind}/`;
    given[kind] = files.map(({ name, bytes }) => ({ name, path: folder + name, bytes }));
    given[kind].forEach(put);
    if (kind === "arm") return imported();
    by(`${kind}-names`).textContent = files.map(({ name }) => name).join(", ") || "none";
}

async function read(list) {
    const files = await Promise.all([...list].map(async (file) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) })));
    return files.sort((a, b) => (a.name < b.name ? -1 : 1));
}

/** The arm file: the given one, or what `dyngen import` makes of a model. */
const armFile = () => (given.arm[0]?.name.endsWith(".toml") ? given.arm[0].path : "arm.toml");

async function imported() {
    const [file] = given.arm;
    if (!file) return;
    by("arm-name").textContent = file.name;
    if (file.name.endsWith(".toml")) return;
    const words = ["import", file.path, "-o", "arm.toml", "--force", ...split(by("import-words").value)];
    const answer = await asked("dyngen", words, "");
    by("arm-name").textContent = answer.code === 0 || answer.code === 3 ? `${file.name}, read as arm.toml` : `${file.name}: not read`;
}

/** Words of a line as a shell takes them, with quotes. */
function split(line) {
    const words = line.match(/(?:[^\s'"]+|'[^']*'|"[^"]*")+/g) || [];
    return words.map((word) => word.replace(/'([^']*)'|"([^"]*)"/g, (_, a, b) => a ?? b));
}

/** Words as they can be typed into a shell. */
const typed = (words) => words.map((word) => (/^[\w./:=,-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`)).join(" ");

// Questions and answers.

function command(question) {
    const paths = (kind) => given[kind].map(({ path }) => path);
    const fit = paths("fit");
    const validate = paths("validate").length ? ["--validate", ...paths("validate")] : [];
    const out = ["--out", RESULTS[question]];
    const more = split(by("more-words").value);
    switch (question) {
        case "log":
            return ["log", ...fit, ...paths("validate"), "--arm", armFile(), ...out, ...more];
        case "compare":
            return ["compare", ...[...fit, ...paths("validate")].slice(0, 2), "--arm", armFile(), ...out, ...more];
        default:
            return [question, "--arm", armFile(), "--log", ...fit, ...validate, ...out, ...more];
    }
}

function idle(is) {
    document.querySelectorAll("button:not(#stop)").forEach((button) => (button.disabled = !is));
    by("stop").hidden = is;
}

/** What a command reports while it runs ends with an ellipsis, and may be written over; the rest of it is for the reader. */
const lines = (err) => err.split("\n").map((line) => line.split(/\r|\x1b\[K/).at(-1));
const isProgress = (line) => / …$/.test(line);

async function asked(program, words, folder) {
    by("answer").hidden = false;
    by("command").textContent = `${program} ${typed(words)}`;
    for (const id of ["words", "errors", "meaning", "downloads"]) by(id).textContent = "";
    by("generate").hidden = by("report").hidden = true;
    by("progress").hidden = false;
    idle(false);
    const began = performance.now();
    let doing = "reading";
    const tick = () => (by("progress").lastElementChild.textContent = `${doing} … ${Math.round((performance.now() - began) / 1000)} s`);
    timer = setInterval(tick, 500);
    tick();
    // Results of before are gone, so that what is offered is of this command.
    if (folder) worker.postMessage({ remove: folder, folder });
    const answer = await ran(program, words, ({ err }) => {
        doing = lines(err).filter(isProgress).at(-1)?.slice(0, -2) || doing;
        tick();
    });
    clearInterval(timer);
    idle(true);
    shown(answer, folder);
    return answer;
}

function shown({ code, seconds, files, out, err }, folder) {
    by("progress").hidden = true;
    const [tone, meaning] = MEANING[code] || ["bad", "The program stopped before its end."];
    by("meaning").className = `note ${tone}`;
    by("meaning").textContent = `${meaning} Exit code ${code}, ${seconds.toFixed(1)} s.`;
    by("words").textContent = out.trimEnd();
    by("errors").textContent = lines(err).filter((line) => !isProgress(line)).join("\n").trimEnd();
    document.querySelectorAll("#downloads a").forEach((link) => URL.revokeObjectURL(link.href));
    const made = files.filter(({ path }) => !Object.values(given).flat().some((file) => file.path === path));
    by("downloads").replaceChildren(...made.filter(({ path }) => inside(path, folder)).map(download));
    const page = made.find(({ path }) => folder && path === `${folder}/report.html`);
    by("report").hidden = !page;
    if (page) by("report").src = URL.createObjectURL(new Blob([page.bytes], { type: "text/html" }));
}

/** Whether a file is of the results: of a folder, or of none where what stands next to the inputs is the result. */
const inside = (path, folder) => (folder ? path.startsWith(`${folder}/`) : !path.includes("/"));

function download({ path, bytes }) {
    const link = document.createElement("a");
    link.download = link.textContent = path.split("/").at(-1);
    link.href = URL.createObjectURL(new Blob([bytes]));
    return link;
}

async function ask(question) {
    const { code } = await asked("powerball", command(question), RESULTS[question]);
    model = code === 0 || code === 3 ? MODEL[question] : undefined;
    by("generate").hidden = !model;
}

async function code(language) {
    const rust = ["generate", "--arm", armFile(), "--model", model, "-o", "code/controller.rs", "--c-header", "code/controller.h"];
    const c = ["generate", armFile(), "--language", "c", "-o", "code/arm.c"];
    await (language === "rust" ? asked("powerball", rust, "code") : asked("dyngen", c, "code"));
    by("generate").hidden = false;
}

// Hands and mice.

for (const place of document.querySelectorAll(".drop")) {
    const kind = place.dataset.for;
    by(`${kind}-file`).onchange = async ({ target }) => give(kind, await read(target.files));
    place.ondragover = (event) => {
        event.preventDefault();
        place.classList.add("over");
    };
    place.ondragleave = () => place.classList.remove("over");
    place.ondrop = async (event) => {
        event.preventDefault();
        place.classList.remove("over");
        give(kind, await read(event.dataTransfer.files));
    };
}
by("sample").onclick = async () => {
    for (const [kind, names] of Object.entries(SAMPLE)) {
        const read = async (name) => ({ name, bytes: await unpacked(`sample/${name}`) });
        await give(kind, await Promise.all(names.map(read)));
    }
};
by("import-again").onclick = () => imported();
by("stop").onclick = () => {
    again();
    by("progress").hidden = true;
    by("words").textContent = "stopped";
};
document.querySelectorAll(".ask").forEach((button) => (button.onclick = () => ask(button.dataset.ask)));
document.querySelectorAll("#generate button").forEach((button) => (button.onclick = () => code(button.dataset.code)));
idle(false);
by("stop").hidden = true;
load().then(
    () => idle(true),
    (e) => (by("state").textContent = `They cannot be loaded: ${e.message}`),
);
