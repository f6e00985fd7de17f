// Holds the files and runs the commands, so that the page stays alive meanwhile. What it is asked:
//   {programs: Map of names and modules}    these are there
//   {put: path, bytes}                      a file is there
//   {folder: path}                          a folder is there
//   {remove: path}                          it is gone, or the folder with all that is in it
//   {program, words}                        run: answered by {said: "out" | "err", text} as it is written, then
//                                           {ended: code, seconds, files: [{path, bytes}]}
// A program that breaks off is {failed: why}. Nothing here reads from the network.

const files = new Files();
let programs;

function ran(module, words) {
    const start = performance.now();
    const code = run(module, words, files, (said, text) => postMessage({ said, text }));
    const paths = [...files.nodes].filter(([, node]) => !node.folder).map(([path]) => path);
    const copies = paths.map((path) => ({ path: path.slice(1), bytes: files.get(path).slice() }));
    postMessage({ ended: code, seconds: (performance.now() - start) / 1000, files: copies });
}

onmessage = ({ data }) => {
    try {
        if (data.programs) programs = data.programs;
        if (data.put) files.put(data.put, data.bytes);
        if (data.remove) files.remove(data.remove);
        if (data.folder) files.folder(data.folder);
        if (data.program) ran(programs.get(data.program), [data.program, ...data.words]);
    } catch (e) {
        postMessage({ failed: e.message });
    }
};
