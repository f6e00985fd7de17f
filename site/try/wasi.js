// A machine for one run of a command: files in memory, arguments, a clock and random bytes, behind the calls of WASI
// (wasi_snapshot_preview1) that Rust's standard library makes. There is no network and no file of the computer behind it.
// worker.js stands behind it in one script.

const ERRNO = { SUCCESS: 0, BADF: 8, EXIST: 20, INVAL: 28, ISDIR: 31, NOENT: 44, NOSYS: 52, NOTDIR: 54, NOTEMPTY: 55, SPIPE: 70 };
const KIND = { UNKNOWN: 0, TERMINAL: 2, FOLDER: 3, FILE: 4 };
const OPEN = { CREATE: 1, FOLDER: 2, NEW: 4, EMPTY: 8 };
const APPEND = 1;
/// Handles 0 to 2 are input, output and errors; 3 is the root folder.
const ROOT = 3;

/** The files of the machine by absolute path. A folder is there with its own path. */
class Files {
    constructor() {
        this.nodes = new Map([["/", { folder: true }]]);
    }

    /** `path` without `.`, `..` and doubled slashes. */
    static whole(path) {
        const parts = [];
        for (const part of path.split("/")) {
            if (part === "..") parts.pop();
            else if (part !== "" && part !== ".") parts.push(part);
        }
        return "/" + parts.join("/");
    }

    static folderOf(path) {
        return path.slice(0, path.lastIndexOf("/")) || "/";
    }

    /** Makes a folder and those that it lies in. */
    folder(path) {
        for (let whole = Files.whole(path); !this.nodes.has(whole); whole = Files.folderOf(whole)) {
            this.nodes.set(whole, { folder: true });
        }
    }

    put(path, bytes) {
        const whole = Files.whole(path);
        this.folder(Files.folderOf(whole));
        this.nodes.set(whole, { bytes, size: bytes.length });
    }

    get(path) {
        const node = this.nodes.get(Files.whole(path));
        return node && !node.folder ? node.bytes.subarray(0, node.size) : undefined;
    }

    /** Removes a file, or a folder with all that is in it. */
    remove(path) {
        const whole = Files.whole(path);
        for (const name of [...this.nodes.keys()]) {
            if (name === whole || name.startsWith(whole + "/")) this.nodes.delete(name);
        }
    }

    /** Names of what stands directly in a folder. */
    in(path) {
        const start = path === "/" ? "/" : path + "/";
        const inside = [...this.nodes.keys()].filter((name) => name !== "/" && name.startsWith(start));
        return inside.map((name) => name.slice(start.length)).filter((name) => !name.includes("/"));
    }
}

/** Bytes of a file with room to grow. */
function grown(node, size) {
    if (size > node.bytes.length) {
        const bytes = new Uint8Array(Math.max(size, 2 * node.bytes.length));
        bytes.set(node.bytes.subarray(0, node.size));
        node.bytes = bytes;
    }
    node.size = Math.max(node.size, size);
}

/** What ends a program that says so itself. */
class Exit {
    constructor(code) {
        this.code = code;
    }
}

/**
 * Runs a compiled command to its end.
 * @param module a WebAssembly.Module
 * @param words the command line, the program's name first
 * @param files what it finds and leaves
 * @param said called with "out" or "err" and text as it is written
 * @returns the exit code
 */
function run(module, words, files, said) {
    const machine = new Machine(words, files, said);
    const calls = {};
    for (const { name } of WebAssembly.Module.imports(module)) {
        calls[name] = machine[name] ? machine[name].bind(machine) : () => ERRNO.NOSYS;
    }
    const instance = new WebAssembly.Instance(module, { wasi_snapshot_preview1: calls });
    machine.memory = instance.exports.memory;
    try {
        instance.exports._start();
        return 0;
    } catch (ended) {
        if (ended instanceof Exit) return ended.code;
        throw ended;
    } finally {
        machine.flush();
    }
}

/** One run: its handles and its calls, which have the names and the arguments that WASI gives them. */
class Machine {
    constructor(words, files, said) {
        const bytes = new TextEncoder();
        const ended = (text) => bytes.encode(text + "\0");
        this.words = words.map(ended);
        // A terminal gets progress, and no colours.
        this.environment = ["NO_COLOR=1"].map(ended);
        this.files = files;
        this.said = said;
        this.decoders = { 1: new TextDecoder(), 2: new TextDecoder() };
        this.handles = new Map([[ROOT, { path: "/", node: files.nodes.get("/"), at: 0n, flags: 0 }]]);
        this.next = ROOT + 1;
    }

    view() {
        return new DataView(this.memory.buffer);
    }

    text(at, length) {
        return new TextDecoder().decode(new Uint8Array(this.memory.buffer, at, length).slice());
    }

    path(handle, at, length) {
        const folder = this.handles.get(handle);
        const text = this.text(at, length);
        return Files.whole(text.startsWith("/") ? text : `${folder ? folder.path : ""}/${text}`);
    }

    flush() {
        for (const stream of [1, 2]) {
            const rest = this.decoders[stream].decode();
            if (rest) this.said(stream === 1 ? "out" : "err", rest);
        }
    }

    // Arguments, environment.

    list(items, places, at) {
        for (const item of items) {
            this.view().setUint32(places, at, true);
            new Uint8Array(this.memory.buffer).set(item, at);
            places += 4;
            at += item.length;
        }
        return ERRNO.SUCCESS;
    }

    sizes(items, count, size) {
        this.view().setUint32(count, items.length, true);
        this.view().setUint32(size, items.reduce((sum, item) => sum + item.length, 0), true);
        return ERRNO.SUCCESS;
    }

    args_get(places, at) {
        return this.list(this.words, places, at);
    }

    args_sizes_get(count, size) {
        return this.sizes(this.words, count, size);
    }

    environ_get(places, at) {
        return this.list(this.environment, places, at);
    }

    environ_sizes_get(count, size) {
        return this.sizes(this.environment, count, size);
    }

    // Time, chance, the end.

    clock_time_get(clock, _precision, out) {
        const now = clock === 0 ? Date.now() : performance.now();
        this.view().setBigUint64(out, BigInt(Math.round(now * 1e6)), true);
        return ERRNO.SUCCESS;
    }

    clock_res_get(_clock, out) {
        this.view().setBigUint64(out, 1000n, true);
        return ERRNO.SUCCESS;
    }

    random_get(at, length) {
        for (let done = 0; done < length; done += 65536) {
            const part = new Uint8Array(Math.min(65536, length - done));
            globalThis.crypto.getRandomValues(part);
            new Uint8Array(this.memory.buffer).set(part, at + done);
        }
        return ERRNO.SUCCESS;
    }

    proc_exit(code) {
        throw new Exit(code);
    }

    sched_yield() {
        return ERRNO.SUCCESS;
    }

    // Handles.

    fd_prestat_get(handle, out) {
        if (handle !== ROOT) return ERRNO.BADF;
        this.view().setUint32(out, 0, true);
        this.view().setUint32(out + 4, 1, true);
        return ERRNO.SUCCESS;
    }

    fd_prestat_dir_name(handle, at) {
        if (handle !== ROOT) return ERRNO.BADF;
        this.view().setUint8(at, "/".charCodeAt(0));
        return ERRNO.SUCCESS;
    }

    fd_fdstat_get(handle, out) {
        const open = this.handles.get(handle);
        if (!open && handle >= ROOT) return ERRNO.BADF;
        // Progress is for a reader who waits: errors go to a terminal. Nothing is read from one.
        const stream = handle === 2 ? KIND.TERMINAL : KIND.UNKNOWN;
        const view = this.view();
        view.setBigUint64(out, 0n, true);
        view.setUint8(out, open ? this.kind(open.node) : stream);
        view.setUint16(out + 2, open ? open.flags : 0, true);
        // Streams can be read and written, and have no place in them; so a terminal differs from a file.
        const rights = open ? 0x1fffffffn : 0x42n;
        view.setBigUint64(out + 8, rights, true);
        view.setBigUint64(out + 16, rights, true);
        return ERRNO.SUCCESS;
    }

    fd_fdstat_set_flags(handle, flags) {
        const open = this.handles.get(handle);
        if (open) open.flags = flags;
        return open ? ERRNO.SUCCESS : ERRNO.BADF;
    }

    kind(node) {
        return node.folder ? KIND.FOLDER : KIND.FILE;
    }

    stat(node, out) {
        const view = this.view();
        new Uint8Array(this.memory.buffer, out, 64).fill(0);
        view.setUint8(out + 16, this.kind(node));
        view.setBigUint64(out + 24, 1n, true);
        view.setBigUint64(out + 32, BigInt(node.size || 0), true);
        return ERRNO.SUCCESS;
    }

    fd_filestat_get(handle, out) {
        const open = this.handles.get(handle);
        if (!open) return handle < ROOT ? ERRNO.NOSYS : ERRNO.BADF;
        return this.stat(open.node, out);
    }

    fd_filestat_set_size(handle, size) {
        const open = this.handles.get(handle);
        if (!open || open.node.folder) return ERRNO.BADF;
        const { node } = open;
        grown(node, Number(size));
        node.bytes.fill(0, Number(size));
        node.size = Number(size);
        return ERRNO.SUCCESS;
    }

    fd_filestat_set_times() {
        return ERRNO.SUCCESS;
    }

    fd_advise() {
        return ERRNO.SUCCESS;
    }

    fd_sync() {
        return ERRNO.SUCCESS;
    }

    fd_datasync() {
        return ERRNO.SUCCESS;
    }

    fd_close(handle) {
        return this.handles.delete(handle) ? ERRNO.SUCCESS : ERRNO.BADF;
    }

    fd_renumber(from, to) {
        const open = this.handles.get(from);
        if (!open) return ERRNO.BADF;
        this.handles.set(to, open);
        this.handles.delete(from);
        return ERRNO.SUCCESS;
    }

    fd_seek(handle, offset, whence, out) {
        const open = this.handles.get(handle);
        if (!open) return handle < ROOT ? ERRNO.SPIPE : ERRNO.BADF;
        const at = [0n, open.at, BigInt(open.node.size || 0)][whence] + offset;
        if (at < 0n) return ERRNO.INVAL;
        open.at = at;
        this.view().setBigUint64(out, at, true);
        return ERRNO.SUCCESS;
    }

    fd_tell(handle, out) {
        return this.fd_seek(handle, 0n, 1, out);
    }

    /** The pieces of memory that a call reads into or writes from. */
    pieces(at, count) {
        const view = this.view();
        const piece = (k) => [view.getUint32(at + 8 * k, true), view.getUint32(at + 8 * k + 4, true)];
        return Array.from({ length: count }, (_, k) => new Uint8Array(this.memory.buffer, ...piece(k)));
    }

    fd_read(handle, pieces, count, out) {
        const open = this.handles.get(handle);
        if (!open) {
            // Nobody types: standard input is at its end.
            this.view().setUint32(out, 0, true);
            return handle === 0 ? ERRNO.SUCCESS : ERRNO.BADF;
        }
        const done = this.fd_pread(handle, pieces, count, open.at, out);
        if (done === ERRNO.SUCCESS) open.at += BigInt(this.view().getUint32(out, true));
        return done;
    }

    fd_pread(handle, pieces, count, offset, out) {
        const open = this.handles.get(handle);
        if (!open) return ERRNO.BADF;
        if (open.node.folder) return ERRNO.ISDIR;
        let at = Number(offset);
        const start = at;
        for (const piece of this.pieces(pieces, count)) {
            const part = open.node.bytes.subarray(at, Math.min(open.node.size, at + piece.length));
            piece.set(part);
            at += part.length;
            if (part.length < piece.length) break;
        }
        this.view().setUint32(out, at - start, true);
        return ERRNO.SUCCESS;
    }

    fd_write(handle, pieces, count, out) {
        const open = this.handles.get(handle);
        if (!open) return handle === 1 || handle === 2 ? this.say(handle, pieces, count, out) : ERRNO.BADF;
        if (open.flags & APPEND) open.at = BigInt(open.node.size || 0);
        const done = this.fd_pwrite(handle, pieces, count, open.at, out);
        if (done === ERRNO.SUCCESS) open.at += BigInt(this.view().getUint32(out, true));
        return done;
    }

    say(handle, pieces, count, out) {
        let size = 0;
        for (const piece of this.pieces(pieces, count)) {
            const text = this.decoders[handle].decode(piece.slice(), { stream: true });
            if (text) this.said(handle === 1 ? "out" : "err", text);
            size += piece.length;
        }
        this.view().setUint32(out, size, true);
        return ERRNO.SUCCESS;
    }

    fd_pwrite(handle, pieces, count, offset, out) {
        const open = this.handles.get(handle);
        if (!open || open.node.folder) return ERRNO.BADF;
        let at = Number(offset);
        const start = at;
        for (const piece of this.pieces(pieces, count)) {
            grown(open.node, at + piece.length);
            open.node.bytes.set(piece, at);
            at += piece.length;
        }
        this.view().setUint32(out, at - start, true);
        return ERRNO.SUCCESS;
    }

    fd_readdir(handle, at, length, cookie, out) {
        const open = this.handles.get(handle);
        if (!open || !open.node.folder) return ERRNO.NOTDIR;
        const bytes = new Uint8Array(this.memory.buffer, at, length);
        const names = this.files.in(open.path);
        let used = 0;
        for (let k = Number(cookie); k < names.length && used < length; k++) {
            const name = new TextEncoder().encode(names[k]);
            const entry = new Uint8Array(24 + name.length);
            const view = new DataView(entry.buffer);
            view.setBigUint64(0, BigInt(k + 1), true);
            view.setUint32(16, name.length, true);
            const node = this.files.nodes.get(Files.whole(`${open.path}/${names[k]}`));
            view.setUint8(20, this.kind(node));
            entry.set(name, 24);
            bytes.set(entry.subarray(0, length - used), used);
            used = Math.min(length, used + entry.length);
        }
        this.view().setUint32(out, used, true);
        return ERRNO.SUCCESS;
    }

    // Paths.

    path_open(folder, _links, at, length, how, _rights, _inherited, flags, out) {
        const path = this.path(folder, at, length);
        let node = this.files.nodes.get(path);
        if (node && how & OPEN.NEW) return ERRNO.EXIST;
        if (node && how & OPEN.FOLDER && !node.folder) return ERRNO.NOTDIR;
        if (!node) {
            const parent = this.files.nodes.get(Files.folderOf(path));
            if (!(how & OPEN.CREATE) || !parent) return ERRNO.NOENT;
            if (!parent.folder) return ERRNO.NOTDIR;
            node = { bytes: new Uint8Array(4096), size: 0 };
            this.files.nodes.set(path, node);
        }
        if (how & OPEN.EMPTY && !node.folder) node.size = 0;
        this.handles.set(this.next, { path, node, at: 0n, flags });
        this.view().setUint32(out, this.next++, true);
        return ERRNO.SUCCESS;
    }

    path_filestat_get(folder, _links, at, length, out) {
        const node = this.files.nodes.get(this.path(folder, at, length));
        return node ? this.stat(node, out) : ERRNO.NOENT;
    }

    path_filestat_set_times() {
        return ERRNO.SUCCESS;
    }

    path_readlink(folder, at, length) {
        // There are no links.
        return this.files.nodes.has(this.path(folder, at, length)) ? ERRNO.INVAL : ERRNO.NOENT;
    }

    path_create_directory(folder, at, length) {
        const path = this.path(folder, at, length);
        if (this.files.nodes.has(path)) return ERRNO.EXIST;
        if (!this.files.nodes.has(Files.folderOf(path))) return ERRNO.NOENT;
        this.files.nodes.set(path, { folder: true });
        return ERRNO.SUCCESS;
    }

    path_remove_directory(folder, at, length) {
        const path = this.path(folder, at, length);
        const node = this.files.nodes.get(path);
        if (!node) return ERRNO.NOENT;
        if (!node.folder) return ERRNO.NOTDIR;
        if (this.files.in(path).length > 0) return ERRNO.NOTEMPTY;
        this.files.nodes.delete(path);
        return ERRNO.SUCCESS;
    }

    path_unlink_file(folder, at, length) {
        const path = this.path(folder, at, length);
        const node = this.files.nodes.get(path);
        if (!node) return ERRNO.NOENT;
        if (node.folder) return ERRNO.ISDIR;
        this.files.nodes.delete(path);
        return ERRNO.SUCCESS;
    }

    path_rename(folder, at, length, otherFolder, otherAt, otherLength) {
        const from = this.path(folder, at, length);
        const to = this.path(otherFolder, otherAt, otherLength);
        const node = this.files.nodes.get(from);
        if (!node) return ERRNO.NOENT;
        // Nothing here renames a folder.
        if (node.folder || (this.files.nodes.get(to) || {}).folder) return ERRNO.ISDIR;
        this.files.nodes.delete(from);
        this.files.nodes.set(to, node);
        return ERRNO.SUCCESS;
    }
}
