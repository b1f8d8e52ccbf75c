// Server for work on the pages: serves the built files and passes all else on to a meshsnap server.
//
//     node dev.mjs http://127.0.0.1:8080 [PORT] [PREFIX]

import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import http from "node:http";

const [target = "http://127.0.0.1:8080", port = "8081", prefix = ""] = process.argv.slice(2);
const upstream = new URL(target);
const folder = new URL("../src/server/page/", import.meta.url);

function hash(html, tag) {
  const text = new RegExp(`<${tag}[^>]*>([^]*?)</${tag}>`).exec(html)[1];
  return `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
}

function servePage(answer, name) {
  const html = readFileSync(new URL(name, folder), "utf8");
  answer.writeHead(200, {
    "content-type": "text/html; charset=utf-8",
    "content-security-policy":
      `default-src 'none'; script-src ${hash(html, "script")}; style-src ${hash(html, "style")}; ` +
      "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
  });
  answer.end(html);
}

function pass(request, answer, path) {
  const headers = { ...request.headers, host: upstream.host };
  if (headers.origin) headers.origin = upstream.origin;
  const options = { host: upstream.hostname, port: upstream.port, path, method: request.method, headers };
  const on = http.request(options, (from) => {
    answer.writeHead(from.statusCode, from.headers);
    from.pipe(answer);
  });
  on.on("error", () => answer.destroy());
  answer.on("close", () => on.destroy());
  request.pipe(on);
}

http
  .createServer((request, answer) => {
    if (!request.url.startsWith(prefix)) return answer.writeHead(404).end();
    const path = request.url.slice(prefix.length);
    const page = { "/": "index.html", "/status": "status.html" }[path.split("?")[0]];
    if (page) servePage(answer, page);
    else pass(request, answer, path);
  })
  .listen(Number(port), "127.0.0.1", () => console.log(`http://127.0.0.1:${port}${prefix}/`));
