// Holds the files and runs the commands, so that the page stays alive meanwhile. What it is asked, and what it answers:
//   {put: path, bytes}                      a file is there
//   {folder: path}                          a folder is there
//   {remove: path}                          it is gone, or the folder
//   {program, words}                        → {said: "out" | "err", text} as it is written, then {ended: code, seconds, files}
//   {sample: names}                         → {sample: [{name, bytes}]}
// First it says {ready: true}; what fails, here or in a program, is {failed: why}.

import { Files, run } from "./wasi.js";

const PROGRAMS = ["powerball", "dyngen"];
const files = new Files();

/** A file of this page, unpacked. */
async function fetched(name) {
    const answer = await fetch(`${name}.gz`);
    if (!answer.ok) throw new Error(`${name}: the server answers ${answer.status}`);
    const bytes = new Uint8Array(await answer.arrayBuffer());
    // Some servers have it unpacked on the way.
    if (bytes[0] !== 0x1f || bytes[1] !== 0x8b) return bytes;
    const unpacked = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(unpacked).arrayBuffer());
}

const compiled = Promise.all(PROGRAMS.map(async (name) => [name, await WebAssembly.compile(await fetched(`${name}.wasm`))]));
const programs = compiled.then((pairs) => new Map(pairs));

function ran(module, words) {
    const start = performance.now();
    const code = run(module, words, files, (said, text) => postMessage({ said, text }));
    const paths = [...files.nodes].filter(([, node]) => !node.folder).map(([path]) => path);
    const copies = paths.map((path) => ({ path: path.slice(1), bytes: files.get(path).slice() }));
    postMessage({ ended: code, seconds: (performance.now() - start) / 1000, files: copies });
}

async function asked({ put, bytes, folder, remove, program, words, sample }) {
    if (put) files.put(put, bytes);
    if (remove) files.remove(remove);
    if (folder) files.folder(folder);
    if (program) ran((await programs).get(program), [program, ...words]);
    if (sample) {
        const read = async (name) => ({ name, bytes: await fetched(`sample/${name}`) });
        postMessage({ sample: await Promise.all(sample.map(read)) });
    }
}

// One at a time, in order.
let last = programs.then(
    () => postMessage({ ready: true }),
    (e) => postMessage({ failed: `the programs cannot be loaded: ${e.message}` }),
);
onmessage = ({ data }) => {
    last = last.then(() => asked(data)).catch((e) => postMessage({ failed: e.message }));
};
