//! One good set of readings, and ways to write it as others do.

/// The columns of the good set.
pub const HEADER: &str = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,rx_urad,ry_urad,\
rz_urad,series,direction,temperature_c";

const ROWS: [&str; 6] = [
    "p01,8.2136,4.0079,555.071,200,0,0,0,0,0,65.31,-1.86,-0.42,-11.77,-67.13,-2.01,1,load,19.80",
    "p01,8.2136,4.0079,555.071,1500,0,0,0,0,0,471.44,-17.31,9.83,-32.05,-326.91,7.67,1,load,19.85",
    "p01,8.2136,4.0079,555.071,200,0,0,0,0,0,64.81,-3.15,,-8.39,-57.24,-1.59,1,unload,19.90",
    "p02,-5.5,3.25,540.125,-500,0.5,0,0,5.5,0,-156.46,6.94,-6.20,7.12,156.28,1.75,2,load,20.05",
    "p02,-5.5,3.25,540.125,0,0,-1200,0,0,12.25,-0.73,1.24,-33.50,16.57,173.94,-0.31,2,load,20.10",
    "p03,0,-10,520,0,400,0,-3.75,0,0,2.93,143.42,-2.94,12.94,61.90,1.12,3,load,20.15",
];

/// A table of cells.
#[derive(Clone)]
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

/// The good set.
pub fn good() -> Table {
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    Table { header: cells(HEADER), rows: ROWS.iter().map(|row| cells(row)).collect() }
}

/// A number in decimal digits with its point moved to the right, done with whole numbers.
fn moved(cell: &str, places: i32) -> String {
    if cell.is_empty() {
        return String::new();
    }
    let (whole, fraction) = cell.split_once('.').unwrap_or((cell, ""));
    let digits: i64 = format!("{whole}{fraction}").parse().unwrap();
    let decimals = fraction.len() as i32 - places;
    if decimals <= 0 {
        return (digits * 10_i64.pow(-decimals as u32)).to_string();
    }
    let scale = 10_i64.pow(decimals as u32);
    let sign = if digits < 0 { "-" } else { "" };
    format!("{sign}{}.{:0width$}", digits.abs() / scale, digits.abs() % scale, width = decimals as usize)
}

impl Table {
    pub fn column(&self, name: &str) -> usize {
        self.header.iter().position(|h| h == name).unwrap_or_else(|| panic!("no column {name}"))
    }

    /// Changes the cells of columns.
    pub fn map(mut self, names: &[&str], change: impl Fn(&str) -> String) -> Self {
        for name in names {
            let n = self.column(name);
            self.rows.iter_mut().for_each(|row| row[n] = change(&row[n]));
        }
        self
    }

    /// With two columns under the name of the other.
    pub fn exchanged(mut self, one: &str, other: &str) -> Self {
        let (a, b) = (self.column(one), self.column(other));
        self.header.swap(a, b);
        self
    }

    /// Gives columns another name, and moves the point of their numbers.
    pub fn called(mut self, names: &[(&str, &str, i32)]) -> Self {
        for (old, new, places) in names {
            self = self.map(&[old], |cell| moved_or(cell, *places));
            let n = self.column(old);
            self.header[n] = (*new).into();
        }
        self
    }

    /// Decimal commas, but for names.
    pub fn commas(self) -> Self {
        let names: Vec<String> = self.header.iter().filter(|h| *h != "pose").cloned().collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.map(&names, |cell| cell.replace('.', ","))
    }

    /// Without some columns.
    pub fn without(mut self, names: &[&str]) -> Self {
        for name in names {
            let n = self.column(name);
            self.header.remove(n);
            self.rows.iter_mut().for_each(|row| drop(row.remove(n)));
        }
        self
    }

    /// With a column at some place.
    pub fn with(mut self, at: usize, name: &str, cell: &str) -> Self {
        self.header.insert(at, name.into());
        self.rows.iter_mut().for_each(|row| row.insert(at, cell.into()));
        self
    }

    /// With a row above the data: the header's cells replaced where a unit is given.
    pub fn units(mut self, units: &[(&str, &str)]) -> Self {
        let unit = |name: &String| units.iter().find(|(own, _)| own == name).map_or("", |(_, unit)| *unit).to_owned();
        let row = self.header.iter().map(unit).collect();
        self.rows.insert(0, row);
        self
    }

    /// Changes one cell; the row counts from 0.
    pub fn put(mut self, row: usize, name: &str, cell: &str) -> Self {
        let n = self.column(name);
        self.rows[row][n] = cell.into();
        self
    }

    /// Lines with something between the cells, quoted where they hold it.
    pub fn text(&self, separator: char) -> String {
        let quoted = |cell: &String| if cell.contains(separator) { format!("\"{cell}\"") } else { cell.to_owned() };
        let line = |row: &Vec<String>| row.iter().map(quoted).collect::<Vec<_>>().join(&separator.to_string()) + "\n";
        std::iter::once(&self.header).chain(&self.rows).map(line).collect()
    }

    /// As a German spreadsheet separates and writes numbers.
    pub fn german(self) -> String {
        self.commas().text(';').replace('\n', "\r\n")
    }

    /// The numbers of a column, none where a cell is empty.
    pub fn numbers(&self, name: &str) -> Vec<Option<f64>> {
        let n = self.column(name);
        self.rows.iter().map(|row| (!row[n].is_empty()).then(|| row[n].parse().unwrap())).collect()
    }
}

fn moved_or(cell: &str, places: i32) -> String {
    if places == 0 { cell.to_owned() } else { moved(cell, places) }
}

/// UTF-16 with its mark.
pub fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    format!("\u{feff}{text}").encode_utf16().flat_map(unit).collect()
}

/// Windows-1252, of texts that have nothing beyond Latin-1.
pub fn windows(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
}

/// UTF-8 with its mark.
pub fn marked(text: &str) -> Vec<u8> {
    format!("\u{feff}{text}").into_bytes()
}
