//! The judgement of a mesh by rules: one result per rule, in the order of the rules, with a sentence and, as far as
//! the rule has them, the number that was found, the number that is allowed, and the first places where the rule is
//! broken. Edges and topology are computed when the first rule needs them. Also the result for a file that cannot be
//! read.

use std::rc::Rc;

use super::places::{self, Faults};
use super::{ALL_PLACES_MAX, Check, Figure, Level, Options, PLACES_MAX, Place, Rule, RuleSet, polygons, uvs, volume};
use crate::geometry::intersections;
use crate::images::checked_header;
use crate::report::Bounds;
use meshsnap_render::import::{MeshError, MeshFault};
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::material::{ImageContent, ImageSource};
use meshsnap_render::mesh::topology::{self, Topology};
use meshsnap_render::pipeline::Model;
use meshsnap_render::pluralise::pluralise;
use meshsnap_render::texture::{decode, fault_warnings};

/// The one check of a file that cannot be read, whether `opens` is among the rules or not.
pub fn unopened(detail: impl Into<String>) -> Check {
    let finding = Finding { ok: false, found: None, allowed: None, detail: detail.into(), places: Vec::new() };
    finding.of(Rule::Opens, Level::Error)
}

/// The check of a file that could not be read. None where that is not the file's fault: of a bundle that cannot be
/// unpacked or in which the mesh is not clear, and of limits.
pub fn of_unreadable(error: &MeshError) -> Option<Check> {
    match error.fault {
        MeshFault::BundleBroken | MeshFault::EntryUnclear | MeshFault::Limit(_) | MeshFault::Stopped => None,
        // Broken, empty, in no format that is known: all that is the file's own.
        _ => Some(unopened(error.to_string())),
    }
}

/// Judges a file: a check for each rule, in the order of the rules. Fails where the time of the job ends, and by its
/// memory unless rules are to tell that.
pub fn check(model: &Model, rules: &RuleSet, options: Options, deadline: &Deadline) -> Result<Vec<Check>, MeshError> {
    let budget = &mut model.budget().clone();
    if options.all_places {
        budget.spend("the places of faults", ALL_PLACES_MAX as u64, size_of::<Place>() as u64)?;
    }
    let places_max = if options.all_places { ALL_PLACES_MAX } else { PLACES_MAX };
    let mut judge = Judge { model, edges: None, topology: None, places_max, budget, deadline };
    let of_rule = |&(rule, level): &(Rule, Level)| {
        deadline.check()?;
        let finding = match judge.finding(rule) {
            Err(error) if options.fails_at_limits && matches!(error.fault, MeshFault::Limit(_)) => {
                Finding::unjudged(&error)
            }
            finding => finding?,
        };
        if options.all_places {
            judge.places_max -= finding.places.len().min(judge.places_max);
        }
        Ok(finding.of(rule, level))
    };
    rules.0.iter().map(of_rule).collect()
}

struct Judge<'a> {
    model: &'a Model,
    /// The edges, once a rule has asked for them.
    edges: Option<Rc<EdgeList>>,
    /// The topology, once a rule has asked for it.
    topology: Option<Rc<Topology>>,
    /// Most places that the next rule lists.
    places_max: usize,
    budget: &'a mut Budget,
    deadline: &'a Deadline,
}

/// A check without the name of its rule.
struct Finding {
    ok: bool,
    found: Option<Figure>,
    allowed: Option<Figure>,
    detail: String,
    places: Vec<Place>,
}

impl Finding {
    fn of(self, rule: Rule, level: Level) -> Check {
        let Self { ok, found, allowed, detail, places } = self;
        Check { rule: rule.name(), level, ok, known: false, found, allowed, detail, places }
    }

    /// A rule that could not be judged, in the words of the limit.
    fn unjudged(error: &MeshError) -> Self {
        let detail = format!("it could not be judged: {error}");
        Self { ok: false, found: None, allowed: None, detail, places: Vec::new() }
    }

    /// Faults, of which none is allowed.
    fn of_faults(faults: Faults, detail: String) -> Self {
        let (found, allowed) = (Some(Figure::Count(faults.count)), Some(Figure::Count(0)));
        Self { ok: faults.count == 0, found, allowed, detail, places: faults.places }
    }

    /// A count that has a limit.
    fn at_most(found: u64, allowed: u64, one: &str, more: &str) -> Self {
        let detail = match found > allowed {
            true => format!("{}, and {allowed} allowed", pluralise(found, one, more)),
            false => pluralise(found, one, more),
        };
        let (found_figure, allowed_figure) = (Some(Figure::Count(found)), Some(Figure::Count(allowed)));
        Self { ok: found <= allowed, found: found_figure, allowed: allowed_figure, detail, places: Vec::new() }
    }

    /// Something that is there or not.
    fn presence(ok: bool, there: &str, absent: &str) -> Self {
        let detail = if ok { there } else { absent }.to_owned();
        Self { ok, found: None, allowed: None, detail, places: Vec::new() }
    }
}

impl Judge<'_> {
    fn finding(&mut self, rule: Rule) -> Result<Finding, MeshError> {
        let (mesh, import) = (self.model.mesh(), self.model.report());
        Ok(match rule {
            Rule::Opens => Finding::presence(true, "it opens", ""),
            Rule::NoWarnings => self.warnings(),
            Rule::Watertight => self.watertight()?,
            Rule::Manifold => self.manifold()?,
            Rule::ConsistentWinding => self.winding()?,
            Rule::NoDegenerate => {
                // Reading drops these faces, and keeps the places of the first.
                let count = import.dropped_degenerate_faces + import.dropped_collapsed_faces;
                let detail = pluralise(count, "face without area", "faces without area");
                let places = import.degenerate_places.iter().take(self.places_max);
                let places = places.map(|corners| places::corners(mesh, *corners)).collect();
                Finding::of_faults(Faults { count, places }, detail)
            }
            Rule::NoDuplicateFaces => {
                let faces = topology::duplicate_faces(mesh, self.budget)?;
                let faults = Faults::at(faces.into_iter(), self.places_max, |face| places::face(mesh, face));
                let detail = pluralise(faults.count, "face repeats an earlier one", "faces repeat earlier ones");
                Finding::of_faults(faults, detail)
            }
            Rule::NoSelfIntersection => {
                let Some(faces) = intersections::self_intersections(mesh, self.budget, self.deadline)? else {
                    let detail = "so many faces lie above each other that comparing them would take too long";
                    return Ok(Finding::presence(false, "", detail));
                };
                let faults = Faults::at(faces.into_iter(), self.places_max, |face| places::face(mesh, face));
                let detail = pluralise(faults.count, "face intersects another", "faces intersect others");
                Finding::of_faults(faults, detail)
            }
            Rule::NoInvertedVolume => self.inverted()?,
            Rule::NoLooseVertices => {
                // Reading leaves these vertices out, and their places with them.
                let count = import.loose_vertices.unwrap_or(0);
                let (one, more) = ("vertex that nothing refers to", "vertices that nothing refers to");
                Finding::of_faults(Faults::without_places(count), pluralise(count, one, more))
            }
            Rule::NoNgons => {
                let count = import.polygons_by_arity[5..].iter().sum();
                let detail = pluralise(count, "polygon with more than 4 corners", "polygons with more than 4 corners");
                let places = match count {
                    0 => Vec::new(),
                    _ => polygons::ngons(mesh, self.budget)?,
                };
                let places = Faults::at(places.into_iter(), self.places_max, |face| places::face(mesh, face)).places;
                Finding::of_faults(Faults { count, places }, detail)
            }
            Rule::SingleComponent => {
                Finding::at_most(self.topology()?.components, 1, "connected part", "connected parts")
            }
            Rule::HasNormals => {
                Finding::presence(!mesh.normals.is_empty(), "it has vertex normals", "it has no vertex normals")
            }
            Rule::HasUv => {
                Finding::presence(!mesh.uvs.is_empty(), "it has texture coordinates", "it has no texture coordinates")
            }
            Rule::UvInRange => {
                let faults = uvs::outside(mesh, self.places_max, self.budget)?;
                let (one, more) = ("vertex lies outside of the texture", "vertices lie outside of the texture");
                let detail = pluralise(faults.count, one, more);
                Finding::of_faults(faults, detail)
            }
            Rule::UvNoOverlap => self.uv_overlaps()?,
            Rule::MaxTriangles(max) => Finding::at_most(mesh.triangles.len() as u64, max, "triangle", "triangles"),
            Rule::MaxVertices(max) => Finding::at_most(import.file_vertices, max, "vertex", "vertices"),
            Rule::MaxMaterials(max) => Finding::at_most(mesh.materials.len() as u64, max, "material", "materials"),
            Rule::MaxTexturePx(max) => self.textures(max),
            Rule::MaxFileBytes(max) => Finding::at_most(import.file_bytes, max, "byte", "bytes"),
            Rule::Bounds(allowed) => bounds(mesh, allowed),
        })
    }

    fn edges(&mut self) -> Result<Rc<EdgeList>, MeshError> {
        if let Some(edges) = &self.edges {
            return Ok(edges.clone());
        }
        let edges = EdgeList::of(self.model.mesh(), self.budget)?;
        self.deadline.check()?;
        Ok(self.edges.insert(Rc::new(edges)).clone())
    }

    fn topology(&mut self) -> Result<Rc<Topology>, MeshError> {
        if let Some(topology) = &self.topology {
            return Ok(topology.clone());
        }
        let edges = self.edges()?;
        let topology = Topology::of(self.model.mesh(), &edges, self.budget, self.deadline)?;
        Ok(self.topology.insert(Rc::new(topology)).clone())
    }

    fn warnings(&self) -> Finding {
        let images = self.model.mesh().images.iter();
        let fault = |image: &ImageSource| match &image.content {
            ImageContent::Encoded(bytes) => checked_header(&image.name, bytes).err(),
            ImageContent::Absent => None,
        };
        let faults: Vec<_> = images.filter_map(fault).collect();
        let of_images = fault_warnings(&faults);
        let all: Vec<&str> =
            self.model.report().warnings.iter().chain(&of_images).map(|warning| warning.detail.as_str()).collect();
        let detail = match all.as_slice() {
            [] => "no warnings".to_owned(),
            [one] => (*one).to_owned(),
            [first, ..] => format!("{} warnings, the first: {first}", all.len()),
        };
        Finding::of_faults(Faults::without_places(all.len() as u64), detail)
    }

    fn watertight(&mut self) -> Result<Finding, MeshError> {
        let mesh = self.model.mesh();
        let edges = self.edges()?;
        if edges.is_empty() {
            return Ok(Finding::presence(false, "", "it has no faces"));
        }
        let leaks = edges.iter().filter(|edge| edge.face_count != 2 || edge.has_inconsistent_winding);
        let faults = Faults::at(leaks, self.places_max, |edge| places::edge(mesh, &edge));
        if faults.count == 0 {
            return Ok(Finding::of_faults(faults, "it is watertight".to_owned()));
        }
        let topology = self.topology()?;
        let mut said = Vec::new();
        if topology.open_edges > 0 {
            let open = pluralise(topology.open_edges, "open edge", "open edges");
            said.push(format!("{open} in {}", pluralise(topology.boundary_loops, "loop", "loops")));
        }
        let more = [
            (topology.nonmanifold_edges, "edge with more than two faces", "edges with more than two faces"),
            (
                topology.inconsistent_edges,
                "edge between faces that look to different sides",
                "edges between faces that look to different sides",
            ),
        ];
        said.extend(more.into_iter().filter(|(n, ..)| *n > 0).map(|(n, one, many)| pluralise(n, one, many)));
        Ok(Finding::of_faults(faults, said.join(", ")))
    }

    fn manifold(&mut self) -> Result<Finding, MeshError> {
        let mesh = self.model.mesh();
        let edges = self.edges()?;
        let of_edges =
            Faults::at(edges.iter().filter(|e| e.face_count > 2), self.places_max, |e| places::edge(mesh, &e));
        let vertices = topology::nonmanifold_vertices(mesh, &edges, self.budget)?;
        let of_vertices = Faults::at(vertices.into_iter(), self.places_max, |vertex| places::vertex(mesh, vertex));
        let detail = match (of_edges.count, of_vertices.count) {
            (0, 0) => "it is manifold".to_owned(),
            (edges, vertices) => {
                let (one, more) = ("edge with more than two faces", "edges with more than two faces");
                let of_edges = (edges > 0).then(|| pluralise(edges, one, more));
                let (one, more) = ("vertex where surfaces touch", "vertices where surfaces touch");
                let of_vertices = (vertices > 0).then(|| pluralise(vertices, one, more));
                of_edges.into_iter().chain(of_vertices).collect::<Vec<_>>().join(", ")
            }
        };
        Ok(Finding::of_faults(of_edges.and(of_vertices, self.places_max), detail))
    }

    fn winding(&mut self) -> Result<Finding, MeshError> {
        let mesh = self.model.mesh();
        let edges = self.edges()?;
        let turned = edges.iter().filter(|edge| edge.face_count == 2 && edge.has_inconsistent_winding);
        let faults = Faults::at(turned, self.places_max, |edge| places::edge(mesh, &edge));
        let (one, more) =
            ("edge between faces that look to different sides", "edges between faces that look to different sides");
        let detail = pluralise(faults.count, one, more);
        Ok(Finding::of_faults(faults, detail))
    }

    fn inverted(&mut self) -> Result<Finding, MeshError> {
        let edges = self.edges()?;
        let (faults, closed) = volume::inverted(self.model.mesh(), &edges, self.places_max, self.budget)?;
        let detail = match (faults.count, closed) {
            (_, 0) => "it has no closed part whose volume has a sign".to_owned(),
            (count, closed) => {
                let closed = pluralise(closed, "closed part", "closed parts");
                format!("{count} of {closed} inside out")
            }
        };
        Ok(Finding::of_faults(faults, detail))
    }

    fn uv_overlaps(&mut self) -> Result<Finding, MeshError> {
        let (faults, is_complete) = uvs::overlaps(self.model.mesh(), self.places_max, self.budget, self.deadline)?;
        let detail = pluralise(faults.count, "face overlaps another", "faces overlap others");
        let at_least = if is_complete { "" } else { "at least " };
        Ok(Finding::of_faults(faults, format!("{at_least}{detail} in the texture")))
    }

    fn textures(&self, max_px: u64) -> Finding {
        let mut largest = (0, "");
        for image in &self.model.mesh().images {
            let ImageContent::Encoded(bytes) = &image.content else { continue };
            // An image that cannot be read is a warning, and has no size.
            let Ok(header) = decode::header(&image.name, bytes) else { continue };
            let side_px = u64::from(header.width.max(header.height));
            if side_px > largest.0 {
                largest = (side_px, &image.name);
            }
        }
        let (found, name) = largest;
        let detail = match found {
            0 => "it has no texture that can be read".to_owned(),
            _ if found > max_px => format!("{name} is {found} px on its longer side, and {max_px} px allowed"),
            _ => format!("{found} px at most"),
        };
        Finding { detail, ..Finding::at_most(found, max_px, "pixel", "pixels") }
    }
}

/// The extent of a mesh along each axis.
fn bounds(mesh: &Mesh, allowed: [f64; 3]) -> Finding {
    let size = Bounds::of(mesh).size;
    let is_over = |axis: &usize| size[*axis] > allowed[*axis];
    let over: Vec<String> = (0..3)
        .filter(is_over)
        .map(|axis| format!("{} along {}, and {} allowed", size[axis], ["x", "y", "z"][axis], allowed[axis]))
        .collect();
    let detail = match over.as_slice() {
        [] => format!("{} x {} x {}", size[0], size[1], size[2]),
        over => over.join("; "),
    };
    let (found, allowed) = (Some(Figure::Size(size)), Some(Figure::Size(allowed)));
    Finding { ok: over.is_empty(), found, allowed, detail, places: Vec::new() }
}
