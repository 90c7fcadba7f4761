//! Data at points and cells of a legacy `.vtk` file: region numbers and fibre directions are kept, the
//! rest is skipped.

use std::io::Read;

use super::super::tokens::{ReadError, quoted, syntax};
use super::VtkFile;
use super::scalar::Scalar;

/// Cell data of these names are region numbers.
const REGION_NAMES: [&str; 3] = ["region", "regions", "material"];

/// Cell data of these names are the fibre directions of the two families.
const FIBRE_NAMES: [&[&str]; 2] = [&["fibres", "fibers"], &["fibres_2", "fibers_2"]];

/// What attributes belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    Dataset,
    Points(usize),
    Cells(usize),
}

impl<R: Read> VtkFile<R> {
    /// Reads or skips the attribute that begins with `keyword`.
    pub(super) fn attribute(&mut self, keyword: &str, owner: Owner) -> Result<(), ReadError> {
        if keyword == "FIELD" {
            return self.field(owner);
        }
        let count = match owner {
            Owner::Points(count) | Owner::Cells(count) => count,
            Owner::Dataset => 0,
        };
        let width = match keyword {
            "SCALARS" => return self.scalars(owner, count),
            "COLOR_SCALARS" => {
                self.values.word("a name")?;
                let width = self.values.count("COLOR_SCALARS")?;
                self.values.begin_data()?;
                return self.values.skip(width.saturating_mul(count), Scalar::U8);
            }
            "LOOKUP_TABLE" => {
                self.values.word("a name")?;
                let size = self.values.count("LOOKUP_TABLE")?;
                self.values.begin_data()?;
                return self.values.skip(size.saturating_mul(4), Scalar::U8);
            }
            "TEXTURE_COORDINATES" => {
                self.values.word("a name")?;
                let width = self.values.count("TEXTURE_COORDINATES")?;
                return self.skip_typed(width.saturating_mul(count));
            }
            "VECTORS" => {
                let name = self.values.word("a name")?;
                let scalar = self.values.scalar_type()?;
                self.values.begin_data()?;
                return self.array(&name, owner, 3, count, scalar);
            }
            "NORMALS" => 3,
            "TENSORS" => 9,
            "TENSORS6" => 6,
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => 1,
            _ => {
                return syntax(format!(
                    "expected a section of a .vtk file such as POINTS or CELLS, found {}",
                    quoted(keyword)
                ));
            }
        };
        self.values.word("a name")?;
        self.skip_typed(count.saturating_mul(width))
    }

    fn skip_typed(&mut self, count: usize) -> Result<(), ReadError> {
        let scalar = self.values.scalar_type()?;
        self.values.begin_data()?;
        self.values.skip(count, scalar)
    }

    fn scalars(&mut self, owner: Owner, count: usize) -> Result<(), ReadError> {
        let name = self.values.word("a name")?;
        let scalar = self.values.scalar_type()?;
        // The number of components may be left out.
        let rest = self.values.tokens.rest_of_line()?.unwrap_or_default();
        let width: usize = match rest.trim() {
            "" => 1,
            width => match width.parse() {
                Ok(width) => width,
                Err(_) => {
                    return syntax(format!(
                        "expected a number of components, found {}",
                        quoted(width)
                    ));
                }
            },
        };
        let table = self.values.word("LOOKUP_TABLE")?;
        if !table.eq_ignore_ascii_case("LOOKUP_TABLE") {
            return syntax(format!("expected LOOKUP_TABLE, found {}", quoted(&table)));
        }
        self.values.word("a name")?;
        self.values.begin_data()?;
        self.array(&name, owner, width, count, scalar)
    }

    fn field(&mut self, owner: Owner) -> Result<(), ReadError> {
        self.values.word("a name")?;
        let arrays = self.values.count("FIELD")?;
        for _ in 0..arrays {
            let mut name = self.values.word("the name of an array")?;
            if name == "METADATA" {
                self.skip_metadata()?;
                name = self.values.word("the name of an array")?;
            }
            let width = self.values.count(&name)?;
            let count = self.values.count(&name)?;
            let scalar = self.values.scalar_type()?;
            if scalar != Scalar::Text || self.values.binary {
                self.values.begin_data()?;
            }
            self.array(&name, owner, width, count, scalar)?;
        }
        Ok(())
    }

    fn array(
        &mut self,
        name: &str,
        owner: Owner,
        width: usize,
        count: usize,
        scalar: Scalar,
    ) -> Result<(), ReadError> {
        let named = |names: &&[&str]| names.iter().any(|fibre| name.eq_ignore_ascii_case(fibre));
        let family = FIBRE_NAMES.iter().position(named);
        if let (Owner::Cells(_), 3, Some(family)) = (owner, width, family)
            && self.fibres[family].is_none()
            && !matches!(scalar, Scalar::Text | Scalar::Bit)
        {
            return self.fibres(name, family, count, scalar);
        }
        let is_region = matches!(owner, Owner::Cells(_))
            && width == 1
            && REGION_NAMES.iter().any(|region| name.eq_ignore_ascii_case(region));
        if !is_region || self.regions.is_some() || scalar == Scalar::Text || scalar == Scalar::Bit {
            return self.values.skip(count.saturating_mul(width), scalar);
        }
        let mut regions = Vec::with_capacity(self.values.plausible(count, 1, scalar));
        let mut odd = None;
        for index in 0..count {
            let whose = || format!("{name} of cell {index}");
            let value = if scalar.is_integer() {
                self.values.integer(scalar, whose)? as f64
            } else {
                self.values.float(scalar, whose)?
            };
            if value.fract() != 0.0 || value.abs() > f64::from(i32::MAX) {
                odd.get_or_insert(value);
            }
            regions.push(value as i32);
        }
        match odd {
            Some(value) => {
                self.notes
                    .push(format!("cell data `{name}` left out: {value} is no region number"));
            }
            None => self.regions = Some(regions),
        }
        Ok(())
    }

    fn fibres(
        &mut self,
        name: &str,
        family: usize,
        count: usize,
        scalar: Scalar,
    ) -> Result<(), ReadError> {
        let mut fibres = Vec::with_capacity(self.values.plausible(count, 3, scalar));
        for index in 0..count {
            let whose = || format!("{name} of cell {index}");
            let x = self.values.float(scalar, whose)?;
            fibres.push([x, self.values.float(scalar, whose)?, self.values.float(scalar, whose)?]);
        }
        self.fibres[family] = Some(fibres);
        Ok(())
    }
}
