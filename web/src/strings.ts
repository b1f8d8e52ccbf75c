/** All words of the pages. */

const NUMBERS = new Intl.NumberFormat("en", { maximumFractionDigits: 1 });

/** A size in binary units, as the server's limits are. */
export function bytes(n: number): string {
  if (n < 1024) return `${n} B`;
  if (n < 1024 ** 2) return `${NUMBERS.format(n / 1024)} KiB`;
  return n < 1024 ** 3 ? `${NUMBERS.format(n / 1024 ** 2)} MiB` : `${NUMBERS.format(n / 1024 ** 3)} GiB`;
}

export function count(n: number): string {
  return new Intl.NumberFormat("en").format(n);
}

const plural = (n: number, one: string, many = `${one}s`): string => `${count(n)} ${n === 1 ? one : many}`;

export const strings = {
  name: "meshsnap",
  title: (mesh: string) => `${mesh} · meshsnap`,
  unnamed: "mesh",
  sampleName: "sample.obj",
  loading: "Loading…",
  skip: "Skip to the picture",

  open: {
    heading: "Drop a mesh here",
    formats: (names: string[]) => `${names.map((n) => n.toUpperCase()).join(", ")}, or a zip of one with its textures`,
    files: "Choose files",
    folder: "Choose a folder",
    sample: "Try a sample",
    another: "Open",
    dropHint: "Drop to open",
    dropCompare: "Drop to compare",
    privacy: (host: string) => `Your file goes to ${host} and nowhere else. The server keeps it until it makes room for others.`,
    limit: (n: number) => `Up to ${bytes(n)}.`,
    sending: (name: string) => `Sending ${name}`,
    reading: "Reading the mesh",
    cancel: "Cancel",
  },

  refused: {
    heading: (name: string) => `${name} was not opened`,
    empty: "The file is empty: it has no bytes.",
    noFiles: "There is no file in what was dropped.",
    tooLarge: (n: number, most: number) =>
      `The files have ${bytes(n)}, and this server takes at most ${bytes(most)}. Nothing was sent.`,
    tooMany: (n: number, most: number) =>
      `There are ${plural(n, "file")}, and this server takes at most ${count(most)} at a time. Nothing was sent.`,
    unreachable: "The server does not answer, or ended the upload.",
    flag: (flag: string) => `The server's operator can raise this limit with ${flag}.`,
    choose: "Which of these is the mesh?",
    again: "Open another file",
    back: "Back to the picture",
  },

  lost: {
    heading: "The mesh is no longer on the server",
    text: (name: string) => `This link shows ${name}. Open that file again, and the same picture comes back.`,
  },

  key: {
    heading: "This server asks for a key",
    text: "It is kept for this tab alone, and sent to this server alone.",
    label: "Key",
    save: "Use this key",
    forget: "Forget the key",
    wrong: "The server does not take this key.",
  },

  connection: {
    gone: "The server does not answer. Trying again…",
    waiting: (s: number) => `The server is busy. Going on in ${plural(s, "second")}.`,
  },

  picture: {
    alt: (name: string, style: string) => `${name}, drawn in the style ${style}`,
    announced: ({ width, height }: { width: number; height: number }) => `Picture of ${width} by ${height} pixels`,
    stage: "Picture. Arrow keys turn it, plus and minus zoom, 0 fits it.",
    hint: "Drag to turn, wheel to zoom, Shift and drag to move, double click to fit",
    refused: "The server refused this picture",
    showKey: (key: string) => `Go to ${key}`,
    zoomIn: "Zoom in",
    zoomOut: "Zoom out",
    fit: "Fit",
    view: "View",
    undo: "Undo",
    views: { auto: "auto", iso: "iso", front: "front", back: "back", left: "left", right: "right", top: "top", bottom: "bottom" },
    background: "Background",
    backgrounds: { white: "White", grey: "Grey gradient", dark: "Dark", transparent: "Transparent" },
    namedViews: "Each view of a sheet has its own direction.",
  },

  tabs: {
    looks: "Looks",
    settings: "Settings",
    materials: "Materials",
    report: "Report",
    explain: "Explain",
    copy: "Copy",
    panels: "Panels",
  },

  looks: {
    styles: "Styles",
    presets: "Looks",
    pick: (name: string) => `Show as ${name}`,
  },

  controls: {
    search: "Search settings",
    undo: "Undo (Ctrl+Z)",
    redo: "Redo (Ctrl+Shift+Z)",
    resetAll: "Reset",
    resetAllHelp: "Back to the default look and view",
    reset: (key: string) => `Reset ${key}`,
    help: (key: string) => `What ${key} means`,
    slider: (key: string) => `${key}, slider`,
    picker: (key: string) => `${key}, colour picker`,
    swatch: (key: string, colour: string) => `${key}: ${colour}`,
    standard: (value: string) => (value === "default" ? "default" : `${value} (default)`),
    byDefault: "default",
    byStyle: "By style",
    none: "One view",
    on: "On",
    off: "Off",
    layer: (name: string) => `Layer ${name}`,
    general: "general",
    noMatch: (words: string) => `No setting matches “${words}”.`,
    setKeys: (n: number) => `${plural(n, "setting")} changed`,
  },

  materials: {
    help: "Settings of one material go over those of the whole picture.",
    none: "This mesh names no materials.",
    search: (n: number) => `Search ${count(n)} materials`,
    more: (n: number) => `Show ${count(n)} more`,
  },

  copy: {
    heading: "Copy as",
    copy: "Copy",
    copied: "Copied",
    failed: "Copying failed: select the text instead",
    share: "Share",
    shareHelp: "Copies a link to this page with the mesh, the view and all settings",
    download: "Download",
    size: "Size",
    window: (size: string) => `Window, ${size.replace("x", " × ")}`,
    custom: "Other…",
    customLabel: "Width and height in pixels, as 640x480",
    format: "Format",
    kinds: {
      url: "URL",
      signed: "Signed URL",
      curl: "curl",
      json: "JSON",
      command: "Command line",
      python: "Python",
      javascript: "JavaScript",
      srcset: "img srcset",
      markdown: "Markdown",
    },
    notes: {
      url: "Shows this picture to everyone who may use the server.",
      signed: "Prints an address that works without a key for a day. Run it where MESHSNAP_API_KEYS has the server's keys.",
      curl: "Stores this picture as a file.",
      json: "The request document: the body of POST v1/render.",
      command: "Draws the same picture without a server, from the file in the working folder.",
      python: "Standard library only.",
      javascript: "For a browser or Node. The picture is in `picture`.",
      srcset: "For pages, with a sharper picture for dense screens.",
      markdown: "For documents and comments.",
    },
    signedNote: "Shows this picture to everyone, without a key, for a day.",
    keyNote: "MESHSNAP_KEY stands for your key.",
  },

  report: {
    triangles: "Triangles", vertices: "Vertices", polygons: "Polygons", materials: "Materials", textures: "Textures",
    format: "Format", file: "File", size: "Size", up: "Up axis", area: "Area", volume: "Volume", components: "Parts",
    openEdges: "Open edges", loops: "Boundary loops", nonmanifold: "Non-manifold edges", inconsistent: "Turned faces at edges",
    watertight: "Watertight", generator: "Made by", animations: "Animations", duplicates: "Duplicate faces",
    yes: "yes", no: "no",
    mesh: "Mesh", topology: "Topology", warnings: "Warnings", checks: "Checks",
    checking: "Checking…",
    passed: "passed", failed: "failed", warned: "warning",
    fault: (n: number) => `Show fault ${n}`,
    kinds: { edge: "edge", face: "face", vertex: "vertex", fault: "fault" },
    faults: "Click a fault to look at it.",
    moreFaults: (n: number) => `and ${count(n)} more`,
    showEdges: "Show edges in colour",
  },

  explain: {
    none: "The times come with the first picture.",
    total: "Here, with the network",
    backend: "Back-end",
    cache: "Cache",
    chosen: "Chosen",
    error: "Expected error",
    errorUnit: (text: string) => `${text} / 255`,
    warnings: "Warnings",
    size: "Picture",
    stages: "Stages",
    cached: "This picture was kept: nothing was drawn for it.",
    ms: (n: number) => `${n < 10 ? n.toFixed(1) : Math.round(n)} ms`,
    skips: "What was skipped and why, on the command line:",
    request: "Request",
  },

  compare: {
    start: "Compare with",
    looks: "a look",
    looksHelp: "Keeps this look on the left side. Then change the settings.",
    mesh: "a mesh…",
    stop: "End comparison",
    left: "Left", right: "Right",
    divider: "Divider between the two pictures",
    heat: "Error heat",
    figures: (rmse: string, most: number, share: string) =>
      `RMSE ${rmse} / 255, largest difference ${most} / 255, ${share} % of the pixels differ`,
    same: "The two pictures are the same, pixel by pixel.",
    keep: "Use the left look",
    kept: "kept look",
    now: "this look",
    differences: "Differences of the meshes",
    sameMesh: "The meshes are the same.",
    distance: (most: string, mean: string) => `Largest distance ${most}, mean ${mean}, in the file's units`,
    heatPicture: "Distance picture",
    differing: "The two pictures differ in size.",
  },

  status: {
    title: "Status",
    page: "To the picture page",
    metrics: "Metrics for Prometheus",
    version: "Version",
    uptime: "Up for",
    backend: "Back-end",
    gpu: "GPU",
    gpuLosses: "GPU lost",
    workers: "Workers",
    servers: "Servers",
    webhooks: "Webhooks waiting",
    quarantined: "Meshes set aside",
    times: (n: number) => (n === 1 ? "once" : `${count(n)} times`),
    busy: (n: number, all: number) => `${count(n)} of ${count(all)} busy`,
    queue: "Queue",
    queueColumns: ["Class", "Waiting", "Running", "Oldest", "Expected wait"],
    shared: "Shared queue",
    sharedColumns: ["Kind", "Messages"],
    oldest: (time: string) => `Oldest job: ${time}`,
    memory: "Memory",
    memoryColumns: ["Account", "Used", "Limit", "Share"],
    resident: "process",
    budget: "all accounts",
    caches: "Caches",
    cacheColumns: ["Cache", "Entries", "Size", "Limit", "Hits", "Misses"],
    kept: "Kept",
    keptColumns: ["Account", "Entries"],
    pictures: "Pictures of stored meshes",
    pictureColumns: ["From", "Pictures", "Share"],
    failures: "Recent failures",
    failureColumns: ["Last", "Place", "Status", "Code", "Detail", "Count"],
    noFailures: "None.",
    updated: (time: string) => `Updated at ${time}`,
    missing: "This server has no status address (v1/status).",
    forbidden: "This key may not see the status: it lacks the scope admin.",
  },
};
