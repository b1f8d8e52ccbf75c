import type { ComponentChildren } from "preact";
import { setStyle } from "../state/edit";
import { report } from "../state/mesh";
import { bytes, count, strings } from "../strings";
import { Checks } from "./checks";
import { Differences } from "./differences";

const words = strings.report;
const figure = (n: number): string => (Number.isInteger(n) ? count(n) : Number(n.toPrecision(4)).toString());

/** What is in the mesh, and what is wrong with it. */
export function ReportPanel() {
  const found = report.value;
  if (!found) return <p class="quiet">{strings.loading}</p>;
  const { topology, bounds } = found;
  return (
    <div class="report" data-test="report">
      <Differences />
      <h2>{words.checks}</h2>
      <Checks />
      <h2>{words.mesh}</h2>
      <dl>
        <Row name={words.format}>{found.format}</Row>
        {found.generator && (
          <Row name={words.generator}>
            <bdi>{found.generator}</bdi>
          </Row>
        )}
        <Row name={words.file}>{bytes(found.file_bytes)}</Row>
        <Row name={words.triangles}>{count(found.triangles)}</Row>
        <Row name={words.polygons}>{count(found.polygons)}</Row>
        <Row name={words.vertices}>{count(found.file_vertices)}</Row>
        <Row name={words.materials}>{count(found.materials.length)}</Row>
        <Row name={words.textures}>{count(found.textures.length)}</Row>
        {bounds && <Row name={words.size}>{bounds.size.map(figure).join(" × ")}</Row>}
        <Row name={words.up}>{String(found.up)}</Row>
        {found.area !== null && <Row name={words.area}>{figure(found.area)}</Row>}
        {found.volume !== null && <Row name={words.volume}>{figure(found.volume)}</Row>}
      </dl>
      {topology && (
        <>
          <h2>
            {words.topology}{" "}
            <button type="button" class="small" onClick={() => setStyle("topology")} data-test="show-topology">
              {words.showEdges}
            </button>
          </h2>
          <dl>
            <Row name={words.watertight}>{topology.is_watertight ? words.yes : words.no}</Row>
            <Row name={words.components}>{count(topology.components)}</Row>
            <Row name={words.openEdges} bad={topology.open_edges > 0}>
              {count(topology.open_edges)}
            </Row>
            <Row name={words.loops}>{count(topology.boundary_loops)}</Row>
            <Row name={words.nonmanifold} bad={topology.nonmanifold_edges > 0}>
              {count(topology.nonmanifold_edges)}
            </Row>
            <Row name={words.inconsistent} bad={topology.inconsistent_edges > 0}>
              {count(topology.inconsistent_edges)}
            </Row>
            <Row name={words.duplicates} bad={topology.duplicate_faces > 0}>
              {count(topology.duplicate_faces)}
            </Row>
          </dl>
        </>
      )}
      <Warnings warnings={found.warnings} />
    </div>
  );
}

function Warnings({ warnings }: { warnings: unknown[] }) {
  if (warnings.length === 0) return null;
  return (
    <>
      <h2>{words.warnings}</h2>
      <ul class="warnings">
        {warnings.map((warning, i) => (
          <li key={i}>{textOfWarning(warning)}</li>
        ))}
      </ul>
    </>
  );
}

function textOfWarning(warning: unknown): string {
  if (typeof warning === "string") return warning;
  const { detail, message, code } = (warning ?? {}) as Record<string, unknown>;
  return String(detail ?? message ?? code ?? JSON.stringify(warning));
}

export function Row({ name, bad = false, children }: { name: string; bad?: boolean; children: ComponentChildren }) {
  return (
    <div class={bad ? "is-bad" : ""}>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}
