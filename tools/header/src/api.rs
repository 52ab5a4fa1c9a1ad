//! `include/api.json`: the C interface as data, for whoever makes bindings.
//!
//! Read from the syntax of the Rust sources, as cbindgen reads them for the header, so that nobody has to take a header
//! apart. What only a description says (which way an argument goes, the shape of an array, whether NULL is allowed) is
//! taken from its `@param` lines.

use crate::Result;
use cbindgen::Config;
use serde::Serialize;
use syn::{Attribute, Expr, Fields, FnArg, Item, Lit, Pat, ReturnType, UnOp};

/// Everything that the header declares, in the order of the sources.
#[derive(Serialize, Default)]
pub struct Api {
    about: &'static str,
    version: String,
    enums: Vec<Enum>,
    objects: Vec<Object>,
    callbacks: Vec<Function>,
    records: Vec<Record>,
    functions: Vec<Function>,
}

#[derive(Serialize)]
struct Enum {
    name: String,
    values: Vec<Value>,
    doc: String,
}

#[derive(Serialize)]
struct Value {
    name: String,
    value: i64,
    doc: String,
}

/// An opaque type, and what frees it.
#[derive(Serialize)]
struct Object {
    name: String,
    free: Option<String>,
    doc: String,
}

#[derive(Serialize)]
struct Record {
    name: String,
    fields: Vec<Field>,
    doc: String,
}

#[derive(Serialize)]
struct Field {
    name: String,
    #[serde(rename = "type")]
    of: Type,
    doc: String,
}

/// A name with any number of `*`; `const` says whether what the first `*` points to is constant.
#[derive(Serialize, Clone)]
struct Type {
    c: String,
    base: String,
    stars: usize,
    #[serde(rename = "const", skip_serializing_if = "std::ops::Not::not")]
    constant: bool,
}

#[derive(Serialize)]
struct Function {
    name: String,
    result: Type,
    parameters: Vec<Parameter>,
    doc: String,
}

#[derive(Serialize)]
struct Parameter {
    name: String,
    #[serde(rename = "type")]
    of: Type,
    /// "in" or "out", as the description says.
    #[serde(skip_serializing_if = "Option::is_none")]
    direction: Option<String>,
    /// Between the brackets of the description: an array.
    #[serde(skip_serializing_if = "Option::is_none")]
    shape: Option<String>,
    /// The argument that holds the length of this array.
    #[serde(skip_serializing_if = "Option::is_none")]
    length: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    nullable: bool,
    /// The enumeration whose numbers it takes.
    #[serde(rename = "enum", skip_serializing_if = "Option::is_none")]
    numbers: Option<String>,
    /// Of objects: "new" (belongs to the caller, who frees it), "shared" (several threads at once may use it), "exclusive"
    /// (one thread), "freed".
    #[serde(skip_serializing_if = "Option::is_none")]
    object: Option<&'static str>,
    doc: String,
}

/// From the texts of the sources, in their order.
pub fn read(version: &str, config: &Config, sources: &[String]) -> Result<String> {
    let mut api = Api {
        about: "The C interface of switchback, written by `make header` from the sources in Rust. type.const: what the first \
                star points to is constant. parameters: direction, shape, length (the argument that holds it), whether NULL is \
                allowed, the enumeration whose numbers are taken, and for objects who owns them: new (the caller, who frees it \
                with the function that the object names), shared (several threads at once), exclusive (one thread), freed. \
                What is false or unknown is left out. Texts and arrays that are returned belong to the library.",
        version: version.to_owned(),
        ..Api::default()
    };
    for source in sources {
        let file = syn::parse_file(source)?;
        for item in &file.items {
            add(&mut api, config, item)?;
        }
    }
    finish(&mut api);
    let mut text = Vec::new();
    let indented = serde_json::ser::PrettyFormatter::with_indent(b" ");
    api.serialize(&mut serde_json::Serializer::with_formatter(&mut text, indented))?;
    text.push(b'\n');
    Ok(String::from_utf8(text)?)
}

fn add(api: &mut Api, config: &Config, item: &Item) -> Result<()> {
    match item {
        Item::Enum(e) if has(&e.attrs, "repr") => {
            let name = exported(config, &e.ident.to_string());
            let plain = doc_lines(&e.attrs).iter().any(|l| l.contains("cbindgen:rename-all=None"));
            let mut values = Vec::new();
            for v in &e.variants {
                let variant = v.ident.to_string();
                let label = if plain { variant } else { shout(&name) + "_" + &shout(&variant) };
                let (_, number) = v.discriminant.as_ref().ok_or(format!("{label} has no number"))?;
                values.push(Value { name: label, value: integer(number)?, doc: doc(&v.attrs) });
            }
            api.enums.push(Enum { name, values, doc: doc(&e.attrs) });
        }
        Item::Struct(s) if has(&s.attrs, "repr") => {
            let mut fields = Vec::new();
            for f in &s.fields {
                let name = f.ident.as_ref().ok_or("a field without a name")?.to_string();
                fields.push(Field { name, of: c_type(config, &f.ty)?, doc: doc(&f.attrs) });
            }
            api.records.push(Record { name: exported(config, &s.ident.to_string()), fields, doc: doc(&s.attrs) });
        }
        Item::Struct(s) if matches!(s.fields, Fields::Unnamed(_)) && s.ident.to_string().starts_with("swb_") => {
            api.objects.push(Object { name: s.ident.to_string(), free: None, doc: doc(&s.attrs) });
        }
        Item::Type(t) if t.ident.to_string().starts_with("swb_") => {
            let f = inner_function(&t.ty).ok_or(format!("{} is no optional function", t.ident))?;
            let mut parameters = Vec::new();
            for a in &f.inputs {
                let name = a.name.as_ref().ok_or(format!("an argument of {} has no name", t.ident))?.0.to_string();
                parameters.push(parameter(name, c_type(config, &a.ty)?));
            }
            api.callbacks.push(described(config, t.ident.to_string(), &f.output, parameters, &t.attrs)?);
        }
        Item::Fn(f) if has(&f.attrs, "no_mangle") => {
            let mut parameters = Vec::new();
            for a in &f.sig.inputs {
                let FnArg::Typed(a) = a else { return Err("a method is exported".into()) };
                let Pat::Ident(name) = &*a.pat else { return Err(format!("{}: no name", f.sig.ident).into()) };
                parameters.push(parameter(name.ident.to_string(), c_type(config, &a.ty)?));
            }
            api.functions.push(described(config, f.sig.ident.to_string(), &f.sig.output, parameters, &f.attrs)?);
        }
        _ => {}
    }
    Ok(())
}

/// Who frees what, and who owns what: for that everything must be known.
fn finish(api: &mut Api) {
    for o in &mut api.objects {
        let free = format!("{}_free", o.name);
        o.free = api.functions.iter().any(|f| f.name == free).then_some(free);
    }
    for f in &mut api.functions {
        for p in &mut f.parameters {
            if !api.objects.iter().any(|o| o.name == p.of.base) {
                continue;
            }
            let freed = f.name == format!("{}_free", p.of.base);
            p.object = Some(match (p.of.stars, p.of.constant) {
                (2, false) if p.direction.as_deref() == Some("out") => "new",
                (_, true) => "shared",
                _ if freed => "freed",
                _ => "exclusive",
            });
        }
    }
}

fn parameter(name: String, of: Type) -> Parameter {
    Parameter {
        name,
        of,
        direction: None,
        shape: None,
        length: None,
        nullable: false,
        numbers: None,
        object: None,
        doc: String::new(),
    }
}

/// A function with what its description says of the arguments.
fn described(
    config: &Config,
    name: String,
    result: &ReturnType,
    mut parameters: Vec<Parameter>,
    attributes: &[Attribute],
) -> Result<Function> {
    let doc = doc(attributes);
    for (direction, argument, text) in descriptions(&doc) {
        let p = parameters.iter_mut().find(|p| p.name == argument);
        let p = p.ok_or(format!("{name} describes {argument}, which is no argument"))?;
        let (shape, rest) = match text.strip_prefix('[').and_then(|t| t.split_once(']')) {
            Some((shape, rest)) => (Some(shape.to_owned()), rest.trim_start().to_owned()),
            None => (None, text),
        };
        // what a constructor leaves behind is no permission
        let allowed = rest.replace("NULL on failure", "");
        p.nullable = words(&allowed).any(|w| w == "NULL") || rest.contains("not wanted");
        p.numbers = words(&rest)
            .zip(words(&rest).skip(1))
            .find(|(a, b)| *a == "enum" && b.starts_with("swb_"))
            .map(|p| p.1.to_owned());
        (p.direction, p.shape, p.doc) = (Some(direction), shape, rest);
    }
    lengths(&mut parameters);
    let result = match result {
        ReturnType::Default => Type { c: "void".into(), base: "void".into(), stars: 0, constant: false },
        ReturnType::Type(_, t) => c_type(config, t)?,
    };
    Ok(Function { name, result, parameters, doc })
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty())
}

/// `@param[in] name text`, over several lines up to an empty one or the next `@`.
fn descriptions(doc: &str) -> Vec<(String, String, String)> {
    let mut found: Vec<(String, String, String)> = Vec::new();
    let mut inside = false;
    for line in doc.lines() {
        let line = line.trim();
        if let Some((direction, rest)) = line.strip_prefix("@param[").and_then(|l| l.split_once(']')) {
            let rest = rest.trim_start();
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            found.push((direction.to_owned(), rest[..end].to_owned(), rest[end..].trim().to_owned()));
            inside = true;
        } else if line.is_empty() || line.starts_with('@') {
            inside = false;
        } else if inside {
            let text = &mut found.last_mut().expect("inside of one").2;
            if !text.is_empty() {
                text.push(' ');
            }
            text.push_str(line);
        }
    }
    for (_, _, text) in &mut found {
        *text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    }
    found
}

/// An array is followed by its length: the argument its shape names, or else the next one that is a length.
fn lengths(parameters: &mut [Parameter]) {
    let is_number = |p: &Parameter| p.of.base == "int64_t" && p.of.stars == 0;
    for at in 0..parameters.len() {
        let p = &parameters[at];
        let (Some(shape), true) = (&p.shape, p.of.stars > 0) else { continue };
        let named = parameters.iter().find(|q| is_number(q) && q.name == *shape);
        let behind = || parameters[at + 1..].iter().filter(|q| is_number(q));
        let own = behind().find(|q| q.name == format!("n_{}", p.name));
        let length = named.or(own).or_else(|| behind().next()).map(|q| q.name.clone());
        parameters[at].length = length;
    }
}

fn inner_function(t: &syn::Type) -> Option<&syn::TypeBareFn> {
    let syn::Type::Path(p) = t else { return None };
    let last = p.path.segments.last().filter(|s| s.ident == "Option")?;
    let syn::PathArguments::AngleBracketed(a) = &last.arguments else { return None };
    match a.args.first()? {
        syn::GenericArgument::Type(syn::Type::BareFn(f)) => Some(f),
        _ => None,
    }
}

fn c_type(config: &Config, t: &syn::Type) -> Result<Type> {
    match t {
        syn::Type::Ptr(p) => {
            let of = c_type(config, &p.elem)?;
            let constant = p.const_token.is_some();
            let word = if constant { "const " } else { "" };
            Ok(match of.stars {
                0 => Type { c: format!("{word}{} *", of.c), stars: 1, constant, ..of },
                _ => Type { c: format!("{}{word}*", of.c), stars: of.stars + 1, ..of },
            })
        }
        syn::Type::Path(p) => {
            let name = p.path.segments.last().ok_or("a type without a name")?.ident.to_string();
            let exported = exported(config, &name);
            let base = match name.as_str() {
                "f64" => "double",
                "i8" => "int8_t",
                "i32" => "int32_t",
                "i64" => "int64_t",
                "u64" => "uint64_t",
                "c_char" => "char",
                "c_void" => "void",
                _ => exported.as_str(),
            };
            Ok(Type { c: base.to_owned(), base: base.to_owned(), stars: 0, constant: false })
        }
        _ => Err("a type that C does not have".into()),
    }
}

fn exported(config: &Config, name: &str) -> String {
    config.export.rename.get(name).cloned().unwrap_or_else(|| name.to_owned())
}

/// `RadauIia` and `rk_family` as `RADAU_IIA` and `RK_FAMILY`, as cbindgen writes them.
fn shout(name: &str) -> String {
    use heck::ToShoutySnakeCase;
    name.to_shouty_snake_case()
}

fn integer(e: &Expr) -> Result<i64> {
    match e {
        Expr::Lit(l) => match &l.lit {
            Lit::Int(i) => Ok(i.base10_parse()?),
            _ => Err("a number that is no integer".into()),
        },
        Expr::Unary(u) if matches!(u.op, UnOp::Neg(_)) => Ok(-integer(&u.expr)?),
        _ => Err("write numbers of enumerations as numbers".into()),
    }
}

fn has(attributes: &[Attribute], name: &str) -> bool {
    attributes.iter().any(|a| a.path().is_ident(name))
}

fn doc_lines(attributes: &[Attribute]) -> Vec<String> {
    let mut lines = Vec::new();
    for a in attributes.iter().filter(|a| a.path().is_ident("doc")) {
        let syn::Meta::NameValue(m) = &a.meta else { continue };
        if let Expr::Lit(l) = &m.value {
            if let Lit::Str(s) = &l.lit {
                lines.extend(s.value().lines().map(|l| l.strip_prefix(' ').unwrap_or(l).trim_end().to_owned()));
                if s.value().is_empty() {
                    lines.push(String::new());
                }
            }
        }
    }
    lines
}

/// The description, without what is meant for cbindgen.
fn doc(attributes: &[Attribute]) -> String {
    let lines = doc_lines(attributes);
    let lines: Vec<&str> = lines.iter().map(String::as_str).filter(|l| !l.starts_with("cbindgen:")).collect();
    lines.join("\n").trim().to_owned()
}
