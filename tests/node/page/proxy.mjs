// A proxy in front of a server: it serves below a path, and can lose its server.

import http from "node:http";

/** A proxy that takes the prefix off each path, and knows no other paths. `target` is a port; null is nobody. */
export async function proxy(target, prefix = "") {
  const state = { target };
  const server = http.createServer((request, answer) => {
    if (state.target === null) return request.socket.destroy();
    if (!request.url.startsWith(`${prefix}/`)) return answer.writeHead(404).end();
    const { method, headers } = request;
    const path = request.url.slice(prefix.length);
    const upstream = http.request({ host: "127.0.0.1", port: state.target, path, method, headers }, (from) => {
      answer.writeHead(from.statusCode, from.headers);
      from.pipe(answer);
    });
    upstream.on("error", () => answer.destroy());
    answer.on("close", () => upstream.destroy());
    request.pipe(upstream);
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  const close = () => {
    server.closeAllConnections();
    server.close();
  };
  return { state, close, url: `http://127.0.0.1:${server.address().port}${prefix}/` };
}
