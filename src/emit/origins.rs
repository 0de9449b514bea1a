//! Makes the record of provenance: which triangle of the input each triangle of the new document comes from. If the input
//! has a record itself, the new one leads to the first input.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use raykiln_formats::record::{Origins, Placed, Record, Source};

use crate::layout::{Content, Layout};
use crate::scene::{InstanceId, Mesh, MeshId, Scene, StandIn};

/// The node that shows a placement of a layout, and the copy within it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShownBy {
    pub(super) node: usize,
    pub(super) copy: u32,
}

/// Origins of the triangles of each primitive of a mesh.
pub(super) type List = Vec<Origins>;

/// Returns the origins of a kept mesh, which has `primitives` in the document: the triangles are its own.
pub(super) fn of_kept(mesh: &Mesh, primitives: usize) -> List {
    let mut list = vec![Origins::Unknown; primitives];
    for geometry in &mesh.geometries {
        let source = Source { node: None, copy: 0, mesh: mesh.source, primitive: geometry.primitive };
        list[geometry.primitive as usize] = Origins::Same(source);
    }
    list
}

/// Makes the record of a layout of `scene`, whose groups have these origins and whose placements are shown by these of
/// `nodes` nodes.
pub(super) fn record(scene: &Scene, layout: &Layout, lists: Vec<List>, shown_by: &[ShownBy], nodes: usize) -> Record {
    let mut own = OwnRecord { scene, of_groups: lists, of_copies: HashMap::new(), lists: Vec::new() };
    let mut placed: Vec<Placed> = Vec::with_capacity(shown_by.len());
    for (placement, by) in layout.placements.iter().zip(shown_by) {
        let is_baked = matches!(layout.groups[placement.group as usize].content, Content::Baked { .. });
        let instance = placement.instance.filter(|_| !is_baked);
        let stand_in = instance.and_then(|i| scene.stand_in(i));
        let list = own.list(placement.group as usize, stand_in);
        let input = instance.map(|InstanceId(i)| &scene.instances[i as usize]).map(|i| (i.node, i.copy));
        placed.push(Placed { node: by.node as u32, copy: by.copy, list, input, stands_in: stand_in.is_some() });
    }
    placed.sort_unstable_by_key(|placed| (placed.node, placed.copy));
    let input_nodes = scene.nodes.min(nodes);
    let nodes = (0..nodes).map(|node| (node < input_nodes).then_some(node as u32)).collect();
    let own = Record { input: scene.geometry, nodes, lists: own.lists, placed };
    scene.provenance.record().and_then(|first| composed(&own, first)).unwrap_or(own)
}

/// What refers to the input itself.
struct OwnRecord<'a> {
    scene: &'a Scene,
    of_groups: Vec<List>,
    /// Indices into `lists` by group, and the mesh that it stands in for.
    of_copies: HashMap<(usize, Option<MeshId>), u32>,
    lists: Vec<List>,
}

impl OwnRecord<'_> {
    fn list(&mut self, group: usize, stand_in: Option<&StandIn>) -> u32 {
        let key = (group, stand_in.map(|stand_in| stand_in.copy));
        if let Some(&list) = self.of_copies.get(&key) {
            return list;
        }
        let list = match stand_in {
            Some(stand_in) => {
                self.of_groups[group].iter().map(|origins| of_copy(self.scene, stand_in, origins)).collect()
            }
            None => self.of_groups[group].clone(),
        };
        self.lists.push(list);
        let list = self.lists.len() as u32 - 1;
        self.of_copies.insert(key, list);
        list
    }
}

/// Returns the origins in the mesh that a model stands in for, given those in the model.
fn of_copy(scene: &Scene, stand_in: &StandIn, origins: &Origins) -> Origins {
    let [model, copy] = [stand_in.model, stand_in.copy].map(|mesh| &scene.meshes[mesh.0 as usize]);
    let count =
        |source: &Source| model.geometries.iter().find(|g| g.primitive == source.primitive).map(|g| g.triangles.len());
    let triangles = match origins {
        Origins::Unknown => 0,
        Origins::Same(source) => count(source).unwrap_or(0),
        Origins::Each { triangles, .. } => triangles.len(),
    };
    let mut collected = Collected::default();
    for triangle in 0..triangles as u32 {
        let in_copy = origins.of(triangle).and_then(|(source, number)| {
            let in_model = scene_triangle(model, source.primitive, number)?;
            let in_copy = stand_in.order.as_ref().map_or(Some(in_model), |order| order.triangle(in_model))?;
            let (geometry, number) = copy.locate(in_copy);
            let geometry = &copy.geometries[geometry];
            let number = geometry.kept.as_ref().map_or(number as u32, |kept| kept[number]);
            Some((Source { node: None, copy: 0, mesh: copy.source, primitive: geometry.primitive }, number))
        });
        match in_copy {
            Some((source, number)) => collected.push(source, number),
            None => return Origins::Unknown,
        }
    }
    collected.origins()
}

/// Returns the number of a triangle through the geometries of a mesh, given its number in a primitive of the file.
fn scene_triangle(mesh: &Mesh, primitive: u32, number: u32) -> Option<u32> {
    let at = mesh.geometries.binary_search_by_key(&primitive, |g| g.primitive).ok()?;
    let geometry = &mesh.geometries[at];
    let within = match &geometry.kept {
        Some(kept) => kept.binary_search(&number).ok()? as u32,
        None => number,
    };
    Some(geometry.first_triangle + within)
}

/// Origins in order of the triangles.
#[derive(Default)]
struct Collected {
    sources: Vec<Source>,
    numbers: HashMap<Source, u32>,
    triangles: Vec<[u32; 2]>,
}

impl Collected {
    fn push(&mut self, source: Source, triangle: u32) {
        let is_last = self.triangles.last().is_some_and(|&[last, _]| self.sources[last as usize] == source);
        let number = match self.triangles.last() {
            Some(&[last, _]) if is_last => last,
            _ => *self.numbers.entry(source).or_insert_with(|| {
                self.sources.push(source);
                self.sources.len() as u32 - 1
            }),
        };
        self.triangles.push([number, triangle]);
    }

    fn origins(self) -> Origins {
        let is_same = (0..).zip(&self.triangles).all(|(i, &[_, triangle])| i == triangle);
        match self.sources.as_slice() {
            [] => Origins::Unknown,
            [source] if is_same => Origins::Same(*source),
            _ => Origins::Each { sources: self.sources, triangles: self.triangles },
        }
    }
}

/// Leads a record of the present input on to the first one, as the input's own record says; `None` if that says nothing of
/// a triangle.
fn composed(own: &Record, first: &Record) -> Option<Record> {
    let mut lists = Vec::new();
    let mut known: HashMap<(u32, Option<u32>), u32> = HashMap::new();
    let mut placed = Vec::with_capacity(own.placed.len());
    for at in &own.placed {
        let through = match at.input {
            Some((node, copy)) => Some(first.placed(node, copy)?),
            None => None,
        };
        let key = (at.list, through.map(|through| through.list));
        let list = match known.get(&key) {
            Some(&list) => list,
            None => {
                let of_primitives = own.lists[at.list as usize].iter();
                lists.push(of_primitives.map(|origins| led_on(origins, at, first)).collect::<Option<List>>()?);
                *known.entry(key).or_insert(lists.len() as u32 - 1)
            }
        };
        let input = through.and_then(|through| through.input);
        let stands_in = at.stands_in || through.is_some_and(|through| through.stands_in);
        placed.push(Placed { list, input, stands_in, ..*at });
    }
    let nodes = own.nodes.iter().map(|&node| first.nodes.get(node? as usize).copied().flatten()).collect();
    Some(Record { input: first.input, nodes, lists, placed })
}

fn led_on(origins: &Origins, at: &Placed, first: &Record) -> Option<Origins> {
    let further: Vec<(&Placed, &Origins, bool)> = origins
        .sources()
        .iter()
        .map(|source| {
            let (node, copy) = source.node.map(|node| (node, source.copy)).or(at.input)?;
            let (placed, origins) = first.origins(node, copy, source.primitive)?;
            Some((placed, origins, source.node.is_some()))
        })
        .collect::<Option<_>>()?;
    // A source without a node is of the node that the placing node stands for; where the node is named, it stays named.
    let filled = |source: Source, placed: &Placed, is_named: bool| match placed.input {
        Some((node, copy)) if is_named && source.node.is_none() => Source { node: Some(node), copy, ..source },
        _ => source,
    };
    match origins {
        Origins::Unknown => Some(Origins::Unknown),
        Origins::Same(_) => {
            let (placed, origins, is_named) = further[0];
            let fill = |source: &Source| filled(*source, placed, is_named);
            Some(match origins {
                Origins::Unknown => return None,
                Origins::Same(source) => Origins::Same(fill(source)),
                Origins::Each { sources, triangles } => {
                    Origins::Each { sources: sources.iter().map(fill).collect(), triangles: triangles.clone() }
                }
            })
        }
        Origins::Each { triangles, .. } => {
            let mut collected = Collected::default();
            for &[source, triangle] in triangles {
                let (placed, origins, is_named) = further[source as usize];
                let (source, triangle) = origins.of(triangle)?;
                collected.push(filled(source, placed, is_named), triangle);
            }
            Some(collected.origins())
        }
    }
}

/// Returns, for each node of the input that another node shows something of, the nodes that do.
pub(super) fn moves(record: &Record) -> BTreeMap<usize, BTreeSet<usize>> {
    let mut of_input: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for placed in &record.placed {
        let named = record.lists[placed.list as usize].iter().flat_map(Origins::sources);
        let nodes = named.filter_map(|source| source.node).chain(placed.input.map(|(node, _)| node));
        for node in nodes {
            of_input.entry(node).or_default().insert(placed.node as usize);
        }
    }
    let standing = record.nodes.iter().enumerate().filter_map(|(node, input)| Some((node, (*input)?)));
    let moved = standing.filter_map(|(node, input)| {
        let mut by = of_input.get(&input)?.clone();
        by.remove(&node);
        (!by.is_empty()).then_some((node, by))
    });
    moved.collect()
}

/// Gives the nodes of a record new numbers, or drops them.
pub(super) fn renumber(record: &mut Record, numbers: &[Option<usize>]) {
    let new = |node: u32| numbers.get(node as usize).copied().flatten().map(|node| node as u32);
    record.placed.retain_mut(|placed| match new(placed.node) {
        Some(node) => {
            placed.node = node;
            true
        }
        None => false,
    });
    let mut kept = numbers.iter().map(Option::is_some);
    record.nodes.retain(|_| kept.next().unwrap_or(true));
}
